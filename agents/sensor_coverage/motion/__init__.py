"""Motion of sensor coverage: drives as generators, visual homing, odometry, and the geometry of a push."""
