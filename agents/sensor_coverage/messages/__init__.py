"""The messages of sensor coverage: between robots, with a coordinator, and with the redundancy advisor."""
