"""The networks without Keras: exported graphs, one for each subnetwork, run by ONNX Runtime."""
