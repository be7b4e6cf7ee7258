"""Calibrate one-shot sensors, whose coloured LEDs are all lit at once."""
