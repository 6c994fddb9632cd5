"""The paper's equations: colour spaces, lobes, shading, environment maps, reflectance maps."""
