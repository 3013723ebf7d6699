"""Network namespaces, and impairments of a real network."""
