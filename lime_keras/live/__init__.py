"""The live page: frames in, a material and its light out, for a browser on the same computer."""
