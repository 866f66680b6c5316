"""Points against a model: their nearest surface point, their side and their depth."""
