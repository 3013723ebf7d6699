"""Motion of a robot of a team: senses, wall following, manoeuvres, and traffic among bodies."""
