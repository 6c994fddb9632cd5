"""Recipes: each set of weights that comes with the package, from nothing, by one command.

A recipe says which corpora, which trainings, in which order: `live.py`, or a file of your own. See
docs/how-to/recipes.md.
"""

from .recipe import NAMES, Corpus, Package, Recipe, Training, find

__all__ = ["NAMES", "Corpus", "Package", "Recipe", "Training", "find"]
