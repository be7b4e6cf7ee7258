"""The colours of pictures' labels, such as those of LEDs."""

BIT_COLOURS = (
    "#e6a03c", "#3c8fe6", "#d1495b", "#4caf7a", "#8e6bbf", "#c9c13b", "#5bc0be", "#b07d62",
)  # fmt: skip
NO_BIT_COLOUR, SEVERAL_COLOUR = "#f2f2f0", "#3a3a3a"


def label_colour(bits: int) -> str:
    """The colour of a label: of its bit, a dark one for several, near white for none."""
    if bits & (bits - 1):
        return SEVERAL_COLOUR
    return BIT_COLOURS[bits.bit_length() - 1] if bits else NO_BIT_COLOUR
