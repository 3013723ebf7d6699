"""What a team knows: facts about the free space, and the map of ends, ports and mates that follows from them."""
