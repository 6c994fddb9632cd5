"""The extensions of the documentation's site."""
