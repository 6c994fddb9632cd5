"""What the cases are made with: precisions, references, strange inputs, verdicts."""
