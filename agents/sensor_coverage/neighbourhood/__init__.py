"""A decentralised robot's knowledge of its neighbourhood: neighbour table, local map, failure detector, beaconing."""
