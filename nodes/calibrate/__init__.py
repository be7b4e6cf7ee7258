"""What presses of known shape teach of film, LEDs and noise.

Finds balls, places the LEDs, fits tables and reflectance, rates and keeps the calibration.
What the other rooms use of it comes through `read_calibration`.
"""
