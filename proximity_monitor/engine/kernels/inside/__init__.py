"""Points against a model: the nearest surface, the side, the depth."""
