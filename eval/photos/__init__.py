"""The answers for photos whose materials nobody measured, and what can be told of them."""
