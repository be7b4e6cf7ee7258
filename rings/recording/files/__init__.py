"""File formats: MCAP with ROS 2 messages, rows of LeRobot datasets."""
