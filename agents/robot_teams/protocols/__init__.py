"""What a team says: its messages, membership, sharing of facts, and the barrier of a corridor."""
