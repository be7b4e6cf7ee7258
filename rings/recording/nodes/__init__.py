"""Recording and replay of streams.

Camera frames as MCAP files that survive a kill, replay, ROS 2 messages in files and on topics.
Another log format goes here.
"""
