"""Numerical stability: a whole system with extreme images, in every precision and format."""
