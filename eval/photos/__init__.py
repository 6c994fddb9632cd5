"""Answers for photos whose materials nobody measured, and how good they are."""
