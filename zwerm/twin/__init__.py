"""The twin: the same scenario over a real network, beside what the radio's models make of the very same packets.

`running` runs it, `comparison` holds the two against each other, `report` prints it. Needs Linux and root.
"""
