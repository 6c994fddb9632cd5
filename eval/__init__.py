"""Evaluation of trained runs: Table 1, speed against accuracy, numerical stability, report."""
