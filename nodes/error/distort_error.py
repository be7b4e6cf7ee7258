"""Bring the height's standard deviation from the ideal grid back to the camera's pixels."""

from tactograph.graph import Close, node
from tactograph.nodes import HeightError, Lens
from tactograph.nodes.optics.bilinear import bilinear
from tactograph.nodes.optics.lens import ideal_places, is_straight


@node(
    neutral="error",
    tolerance=Close(3e-4, why="places are rounded to 1e-5 px, times a step between two pixels"),
)
def distort_error(error: HeightError, lens: Lens) -> HeightError:
    """Return the standard deviation of the height at each pixel of the camera.

    Values between pixels are interpolated linearly: cubic convolution, as in `distort_height`,
    overshoots, and could make a standard deviation negative.  Pixels that look beyond the ideal
    grid repeat its border.  Without a lens the standard deviation is returned unchanged.

    Parameters
    ----------
    error : H x W in mm on the ideal grid
    lens : length 8, from `read_lens` (equations L1 and L2)
    """
    if is_straight(lens):
        return error
    return bilinear(error, *ideal_places(lens, error.shape))


distort_error.opencl(grid="H W", lanes="rows")
distort_error.idle(is_straight)
