"""The page in the browser: parts to drag, and the clearances that a running monitor publishes.

The display is its own node, `proximity_display`. It knows only the monitor's topics, so it runs on
any machine that receives them.
"""
