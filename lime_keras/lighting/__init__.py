"""Section 7: the light of a scene, estimated from its object."""
