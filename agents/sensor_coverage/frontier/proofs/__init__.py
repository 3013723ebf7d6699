"""The proofs of coverage of all slots, and of one slot."""
