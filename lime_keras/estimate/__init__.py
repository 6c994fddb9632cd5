"""From photos to materials, and the files that are written of each."""
