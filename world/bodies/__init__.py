"""Bodies of robots: placement at the start, drives, physics, entering and leaving."""
