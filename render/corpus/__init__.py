"""The corpus writer: sources, worker processes, machines, shards."""
