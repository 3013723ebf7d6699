"""Walks along walls without a coordinator."""
