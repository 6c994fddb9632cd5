"""One scene: what is drawn at random, its G-buffer, its light, and the layers of Eqs. 1 to 4."""
