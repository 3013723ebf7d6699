"""Sharing of logs, registers and orders between robots and the coordinator over a lossy radio."""
