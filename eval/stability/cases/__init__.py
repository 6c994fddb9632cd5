"""The cases of the stability suite, one module for each part of the library."""
