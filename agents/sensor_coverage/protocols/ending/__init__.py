"""The end of a decentralised deployment: the census, the roster of robots that were let out, and the rules of the base."""
