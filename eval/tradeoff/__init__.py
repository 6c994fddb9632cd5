"""Speed against accuracy, over models, runtimes and precisions."""
