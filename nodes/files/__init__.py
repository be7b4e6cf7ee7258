"""Formats of files: images, arrays of images, calibrations, presets, results, surfaces.

Plain functions that nodes share.  A new format goes here.
"""
