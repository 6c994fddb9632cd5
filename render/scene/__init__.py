"""One scene: its random parameters, its G-buffer, its light, and the layers of Eqs. 1 to 4."""
