"""Every numeric part of the package at its extremes: `python -m tests.stability --help`.

A case calls one function with one extreme input in one precision, and compares the result with a
reference. What takes a model is in `lime_keras.eval.stability`, where `lime-eval --stability` tries
a user's own; here are the cases of plain functions, and the command that runs all.
"""
