"""Metrics of a run: those of its end, and those sampled during it."""
