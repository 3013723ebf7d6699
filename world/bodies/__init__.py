"""Bodies and drives of robots."""
