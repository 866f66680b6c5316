"""Studies of the engine: its scenes, and what accuracy costs in time. Does not use ROS."""
