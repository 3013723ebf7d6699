"""The parts of one tick: node status, wake rule, sensing, precomputed readings, command intake, completion, telemetry."""
