"""The cases of the stability suite, with one module for each area of the library."""
