"""The export of a model as SavedModel, ONNX or float16 weights, checked against Keras."""
