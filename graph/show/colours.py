"""The colours of pictures' labels, such as those of LEDs."""

BIT_COLOURS = (
    "#e6a03c", "#3c8fe6", "#d1495b", "#4caf7a", "#8e6bbf", "#c9c13b", "#5bc0be", "#b07d62",
)  # fmt: skip
SEVERAL_COLOUR = "#3a3a3a"
"""Pixels with several bits set; those with none are near white."""
