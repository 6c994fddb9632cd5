"""Numerical stability at the extremes."""
