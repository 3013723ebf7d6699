"""The knowledge of a team: facts about the free space, and the map of ends, ports and mates that follows from them."""
