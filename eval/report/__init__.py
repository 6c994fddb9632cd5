"""The report: one HTML page of numbers, figures and examples."""
