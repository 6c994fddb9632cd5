"""The estimate of materials from videos: fusion over time, tracking, scene cuts (section 5.5)."""
