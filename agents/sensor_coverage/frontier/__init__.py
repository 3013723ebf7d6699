"""Geometry of bearings that the coordinator and the robots share: fence, frontier, holes, paths, and slots."""
