"""Models, the shapes of queries: meshes, surfaces, solids of revolution, and their hierarchies."""
