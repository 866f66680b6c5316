"""The distance of two primitives, and what sweeps them."""
