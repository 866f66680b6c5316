"""Solids of revolution: circles in space, the arcs of profiles, and the tori that these sweep."""
