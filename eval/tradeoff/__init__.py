"""The trade of speed against accuracy, over what users can run."""
