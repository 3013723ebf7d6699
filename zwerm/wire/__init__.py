"""Everything that crosses between processes: messages, keys, the checksum of radio payloads, and the trace of a run."""
