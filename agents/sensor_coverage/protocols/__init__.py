"""Protocols between neighbours: path vector, leave lock, census, token push, membership, mailbox."""
