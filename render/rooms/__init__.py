"""Procedural rooms, path traced to environment maps."""
