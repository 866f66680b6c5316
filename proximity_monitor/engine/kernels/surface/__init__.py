"""Pieces of parametric surfaces: evaluated, divided into cells, bounded, and their nearest points."""
