"""Streams kept and played again.

Camera frames as MCAP that survives a kill, ROS 2 messages, replay.
Another log format goes here.
"""
