"""Bring a height from the ideal grid back to the camera's pixels."""

from tactograph.graph import Close, node
from tactograph.nodes import Height, Lens
from tactograph.nodes.optics.bicubic import between_pixels
from tactograph.nodes.optics.lens import ideal_places, is_straight


@node(
    neutral="height",
    tolerance=Close(3e-4, why="places are rounded to 1e-5 px, times a step between two pixels"),
)
def distort_height(height: Height, lens: Lens) -> Height:
    """Return the height that each pixel of the camera sees: the inverse of `undistort`.

    Values between pixels are interpolated by cubic convolution.  Pixels that look beyond the
    ideal grid, at the border of an image with barrel distortion, repeat its border.  Without a
    lens the height is returned unchanged, bit for bit.  Cubic convolution overshoots at steps, so
    standard deviations have a node without overshoot, `distort_error`.

    Parameters
    ----------
    height : H x W in mm on the ideal grid
    lens : length 8, from `read_lens` (equations L1 and L2)
    """
    if is_straight(lens):
        return height
    return between_pixels(height, *ideal_places(lens, height.shape))


distort_height.opencl(grid="H W", lanes="rows")
distort_height.idle(is_straight)
