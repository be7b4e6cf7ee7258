"""The colours of the LEDs in all pictures."""

LED_COLOURS = (
    "#e6a03c",
    "#3c8fe6",
    "#d1495b",
    "#4caf7a",
    "#8e6bbf",
    "#c9c13b",
    "#5bc0be",
    "#b07d62",
)
SEVERAL_COLOUR = "#3a3a3a"
"""Pixels that several LEDs do not reach; untouched film is near white."""
