"""Motion of sensor coverage: visual homing, and the frame of odometry."""
