"""What runs a controller: the contract, a node without transport, and the robot process."""
