"""A look at a corpus: verification, contact sheets, histograms, layers."""
