"""The page in the browser: parts to drag, and the clearances that a running monitor publishes.

It is a node of its own, `proximity_display`. It knows only the monitor's topics, so it runs on any
machine that hears them.
"""
