"""Everything about a trained model on disk: its folder, its weights, its exported graphs."""
