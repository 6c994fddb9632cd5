"""Scenes made where the training runs: geometry and lights of a bank become batches."""
