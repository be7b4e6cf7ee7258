"""Build the look-up tables from a capture of a known object."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError, node
from tactograph.nodes import U1, Labels, Light, LutLight, LutLit, LutSlope, Mask, Slope
from tactograph.nodes.calibrate import MIN_PIXELS


class Lut(NamedTuple):
    """The K-light table and the K tables that each lack one light, as one list of pixels.

    A pixel belongs to the K-light table if all LEDs reach it, and to the table without
    LED k if all other LEDs do.
    """

    light: LutLight
    slope: LutSlope
    lit: LutLit


@node
def build_lut(light: Light, slope: Slope, mask: Mask, lit: Labels) -> Lut:
    """List light and slope of every calibration pixel that at least K-1 LEDs reach.

    These pixels form the table of the paper's Figure 4 and the tables of section 3.3.  A table
    without one LED has to contain every pixel that the other LEDs reach: built from fully lit
    pixels only, it would end before the steep side begins.

    Parameters
    ----------
    light, slope, mask : of the calibration object: K x H x W, 2 x H x W, H x W
    lit : H x W, bit k-1 set where LED k reaches the pixel

    Raises
    ------
    InputError
        If fewer than 100 pixels can be used.
    """
    chosen = in_tables(mask, lit, len(light))
    refuse_few(chosen, "enough LEDs", "is the ball in the frame, and does every LED flash?")
    return Lut(
        np.ascontiguousarray(light[:, chosen].T),
        np.ascontiguousarray(slope[:, chosen].T),
        lit[chosen],
    )


def refuse_few(reached: NDArray[np.bool_], leds: str, cure: str) -> None:
    """Refuse a calibration object of which too few pixels are reached by these LEDs."""
    if (count := np.count_nonzero(reached)) < MIN_PIXELS:
        few = f"only {count} calibration pixels are reached by {leds} ({MIN_PIXELS} are needed)"
        raise InputError(f"{few}: {cure}")


def in_tables(mask: U1, lit: U1, count: int) -> NDArray[np.bool_]:
    """Return the pixels of known slope that at least `count` - 1 of `count` LEDs reach."""
    reached = np.bitwise_count(lit & np.uint8((1 << count) - 1))
    return (mask > 0) & (reached >= max(3, count - 1))
