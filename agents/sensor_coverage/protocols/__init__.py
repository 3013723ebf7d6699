"""Protocols of sensor coverage, each a component of a robot: commands, routes, locks, census, pushes, membership."""
