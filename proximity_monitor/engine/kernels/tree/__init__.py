"""How a hierarchy is built from triangles."""
