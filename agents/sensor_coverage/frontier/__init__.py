"""Where a swarm ends and where it may go on: the geometry of bearings that the coordinator and the robots share."""
