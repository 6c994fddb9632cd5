"""Numerical stability: the library's parts with extreme inputs and in several precisions."""
