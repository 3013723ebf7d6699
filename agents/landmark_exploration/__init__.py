"""Landmark-based exploration."""
