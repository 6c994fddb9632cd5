"""The corpus writer: sources, worker processes, cluster nodes, shards."""
