"""Formats of files: images, arrays of images, calibrations, presets, recordings, surfaces.

Plain functions that nodes share, and the ROS messages of which recordings are made.  A new format
goes here.
"""
