"""Damaged inputs of every kind through every door of the program: `python -m tests.fuzz --help`.

A door is the function that a command reads one kind of input with. Of every input it either makes
something, or refuses it in one sentence that names the file; whatever else happens is a fault.
"""
