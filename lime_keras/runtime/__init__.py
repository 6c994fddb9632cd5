"""What runs a trained model: ONNX Runtime its graphs, Keras, or TensorFlow a SavedModel."""
