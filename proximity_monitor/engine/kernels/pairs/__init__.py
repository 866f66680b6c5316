"""What differs by the kinds of two models: bounds, leaves, rounding, and the entries."""
