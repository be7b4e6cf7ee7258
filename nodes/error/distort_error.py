"""Bring the height's standard deviation from the ideal grid back to the pixels of the camera."""

from tactograph.graph import Close, node
from tactograph.nodes import HeightError, Lens
from tactograph.nodes.optics.bilinear import bilinear
from tactograph.nodes.optics.lens import ideal_places, is_straight


@node(
    neutral="error",
    tolerance=Close(3e-4, why="places rounded to 1e-5 px, times a step between two pixels"),
)
def distort_error(error: HeightError, lens: Lens) -> HeightError:
    """Return the standard deviation of the height at each pixel of the camera.

    Values between pixels are interpolated linearly.  Cubic convolution, as in `distort_height`,
    overshoots beside the film at rest, and a standard deviation is never negative.  Pixels that
    look beyond the ideal grid repeat its border.  Without a lens the standard deviation is
    returned unchanged.

    Parameters
    ----------
    error : H x W in mm on the ideal grid
    lens : length 8, as `read_lens` gives it (equations L1 and L2 of `lens`)
    """
    if is_straight(lens):
        return error
    return bilinear(error, *ideal_places(lens, error.shape))


distort_error.opencl(grid="H W", lanes="rows")
distort_error.idle(is_straight)
