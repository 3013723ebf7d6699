"""What a run keeps: the history of positions, and recordings in MCAP."""
