"""The tools of the cases: precisions, references, extreme inputs and verdicts."""
