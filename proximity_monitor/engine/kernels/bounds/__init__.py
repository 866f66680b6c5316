"""Bounds of sixteen volumes, or pairs of triangles, at once."""
