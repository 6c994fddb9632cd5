"""Table 1: errors of a trained system on a corpus' test split."""
