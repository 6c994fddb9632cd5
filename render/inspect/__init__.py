"""Inspection of a corpus: verification, contact sheets, histograms, layers."""
