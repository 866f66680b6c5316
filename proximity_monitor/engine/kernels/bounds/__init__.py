"""Lower bounds for sixteen volumes, or sixteen pairs of triangles, at a time."""
