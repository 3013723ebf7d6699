"""Network namespaces, and packet loss, delay and rate limits on a real network."""
