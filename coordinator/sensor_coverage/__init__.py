"""The coordinator of sensor coverage, and the redundancy advisor."""
