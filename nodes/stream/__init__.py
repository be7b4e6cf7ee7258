"""From frames of a camera to touches: which LED lit them, and which belong together.

Plain functions and classes that live, recorded and ROS 2 sources share.
"""
