"""Jitted functions on flat arrays and tuples of floats; they know nothing above them."""
