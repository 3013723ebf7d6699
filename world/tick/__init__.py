"""The parts of one tick: wake rule, command intake, node status, process control, precomputed readings, telemetry."""
