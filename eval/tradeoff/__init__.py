"""The trade-off of speed against accuracy, over models, runtimes and precisions."""
