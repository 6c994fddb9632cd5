"""Mitsuba-rendered corpora: shapes, rooms, G-buffers, shading integrals, TFRecord shards."""
