"""Photos of corpora's scenes: painted, taken by a camera, and kept in files that training reads."""
