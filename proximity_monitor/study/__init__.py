"""Studies of the engine: its scenes, and what accuracy costs in time. Knows nothing of ROS."""
