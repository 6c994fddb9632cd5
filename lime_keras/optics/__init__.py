"""The equations: colour spaces, lobes, shading integrals, environment and reflectance maps."""
