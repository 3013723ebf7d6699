"""What a robot knows about its neighbours: their states, the local map, and failures."""
