"""All that depends on the kinds of both models of a pair: bounds, leaves, rounding, entries."""
