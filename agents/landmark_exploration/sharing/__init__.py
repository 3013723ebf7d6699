"""How robots and the coordinator share logs, registers and orders over a lossy radio."""
