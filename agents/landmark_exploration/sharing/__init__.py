"""Sharing of logs, registers and tasks between robots and the coordinator over a lossy radio."""
