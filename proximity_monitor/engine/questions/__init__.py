"""The questions about two models, and their answers."""
