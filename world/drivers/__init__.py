"""Drivers of the world: the order of one tick, lock-step, real time, and control of the nodes' programs."""
