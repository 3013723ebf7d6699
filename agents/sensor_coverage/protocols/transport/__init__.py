"""Messages over a lossy radio: request de-duplication, reliable segments, and a limited flood."""
