"""Corpora: the record of one example, the pipeline that reads it, and its augmentations."""
