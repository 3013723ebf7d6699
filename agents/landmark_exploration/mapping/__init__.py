"""The map: landmark complex, frontiers, and the choice among them. Pure modules."""
