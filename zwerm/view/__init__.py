"""Pictures and animations of a run."""
