"""Corpora rendered with Mitsuba: shapes, rooms, G-buffers, shading integrals, TFRecord shards."""
