"""Inspection of a corpus: verification, contact sheets, layers, images."""
