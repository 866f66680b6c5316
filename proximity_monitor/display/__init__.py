"""The page in the browser: parts to drag, and the clearances as a running monitor publishes them.

A node of its own, `proximity_display`. It knows what is on the monitor's topics and nothing else,
so it runs on any machine that hears them.
"""
