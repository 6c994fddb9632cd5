"""The estimate of materials from photos, and its files."""
