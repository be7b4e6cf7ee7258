"""Streams kept and played again.

Camera frames as MCAP that survives a kill, replay, ROS 2 messages in files and on topics.
Another log format goes here.
"""
