"""Which LEDs reach a pixel.

Shadow tests and labels, highlights, the shadows that a height casts, and heights from shadows.
A new shadow test goes here.
"""
