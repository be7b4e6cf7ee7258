"""Bring the dark image onto the ideal grid."""

from tactograph.graph import node
from tactograph.nodes import Dark, Lens
from tactograph.nodes.light.undistort import undistort


@node(neutral="dark")
def undistort_dark(dark: Dark, lens: Lens) -> Dark:
    """Return the dark image, resampled like the images of `undistort`.

    Parameters
    ----------
    dark : H x W, all LEDs off
    lens : length 8, from `read_lens`
    """
    plane: Dark = undistort(dark[None], lens)[0]
    return plane
