"""Drivers of the world: lock-step and real time."""
