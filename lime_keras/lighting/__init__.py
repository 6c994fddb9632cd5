"""The light of a scene, estimated from an object in it (section 7)."""
