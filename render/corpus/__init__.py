"""The corpus writer: sources, worker processes, shards."""
