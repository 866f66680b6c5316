"""Pieces of parametric surfaces: their points, their division into cells, and bounds of cells."""
