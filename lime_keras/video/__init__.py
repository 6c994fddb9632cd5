"""From videos to materials: fusion over time, tracking, scene cuts (section 5.5)."""
