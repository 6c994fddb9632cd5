"""The evaluation report: one HTML page of numbers, figures and examples."""
