"""What files hold: images, arrays of images, calibrations, presets, recordings, surfaces.

Plain functions that nodes share.  A new format goes here.
"""
