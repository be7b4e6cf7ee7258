"""Frames of a camera, and touches with their layers, as they flow through a graph.

Plain functions and classes that live, recorded and ROS 2 sources share.
"""
