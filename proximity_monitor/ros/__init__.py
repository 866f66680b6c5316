"""The ROS 2 nodes: the monitor, the player of scripted motion, and the demo of both."""
