"""Pictures on spheres of momenta."""
