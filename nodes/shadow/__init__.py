"""LEDs that reach a pixel.

Shadow tests and labels, highlights, shadows cast by a height and the heights they measure.
A new shadow test goes here.
"""
