"""Protocols of a team: messages, membership, sharing of facts, and the barrier of a corridor."""
