"""Distances of primitives, and the radii and deviations that sweep them."""
