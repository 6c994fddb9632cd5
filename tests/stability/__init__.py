"""Every numeric part of the package at its extremes: `python -m tests.stability --help`.

A case calls one function with one extreme input in one precision, and compares the result with a
reference. `lime_keras.eval.stability`, for `lime-eval --stability`, tries a user's own model; here
are the cases of plain functions and of small systems, and the command that runs all.
"""
