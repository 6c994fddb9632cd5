"""Shapes: procedural surfaces, and triangle meshes from files."""
