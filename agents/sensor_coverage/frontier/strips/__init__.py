"""The strips between the ways of walking robots and the walls that they followed."""
