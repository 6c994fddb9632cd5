"""Pictures, normal maps and videos, from and to files."""
