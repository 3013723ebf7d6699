"""How a robot of a team moves: senses, wall following, manoeuvres, and traffic among bodies."""
