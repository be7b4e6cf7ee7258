"""Calibrate film, LEDs and noise from presses of known shape.

Finds balls, places the LEDs, fits tables and reflectance, rates and stores the calibration.
The other packages use it through `read_calibration`.
"""
