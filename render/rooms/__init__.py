"""Procedural rooms and their path tracing to environment maps."""
