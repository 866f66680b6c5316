"""How a hierarchy is built and fitted: its structure, its volumes, and their layout in memory."""
