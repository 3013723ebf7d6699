"""The controller's contract, a node without transport, and the robot process."""
