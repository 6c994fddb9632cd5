"""Table 1: the errors of a trained system on the test split of a corpus."""
