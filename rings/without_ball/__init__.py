"""Calibration without a ball: by lamps of known places, a mirror ball, or other objects."""
