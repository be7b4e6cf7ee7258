"""Recording and replay of streams: MCAP, ROS 2, Rerun, LeRobot."""
