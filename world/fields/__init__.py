"""Scalar fields over the arena."""
