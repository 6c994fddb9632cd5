"""SavedModel, ONNX and narrow weights, each checked against Keras."""
