"""Corpora: the records of examples, the pipeline that reads them, and its augmentations."""
