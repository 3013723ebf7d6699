"""Motion along walls in touch, and what a robot reports of it."""
