"""The engines that run a trained model: its graphs, Keras, a SavedModel, or one ONNX file."""
