"""Table 1's columns, figures and a report for a trained run."""
