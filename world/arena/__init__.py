"""The arena: shapes, maps, placement of robots, and their entrance."""
