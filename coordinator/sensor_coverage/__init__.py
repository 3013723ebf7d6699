"""The coordinator of sensor coverage, and the redundancy advisor of decentralised robots."""
