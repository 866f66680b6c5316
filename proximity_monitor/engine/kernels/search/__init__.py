"""The one search behind every question about two hierarchies."""
