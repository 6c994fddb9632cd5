"""Banks of geometry and light, from which scenes are made where the training runs."""
