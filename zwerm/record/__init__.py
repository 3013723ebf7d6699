"""Records of a run: the history of positions, and recordings in MCAP."""
