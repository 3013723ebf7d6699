"""The conformance kit: tests whether a controller fulfils the contract."""
