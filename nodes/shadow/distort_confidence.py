"""Bring the labels' confidence from the ideal grid back to the pixels of the camera."""

from tactograph.graph import Flips, node
from tactograph.nodes import Confidence, Lens
from tactograph.nodes.optics.lens import is_straight, nearest_ideal


@node(
    neutral="confidence",
    tolerance=Flips(1e-3, why="places that lie between two pixels, rounded"),
)
def distort_confidence(confidence: Confidence, lens: Lens) -> Confidence:
    """Return the confidence in the labels at each pixel of the camera.

    It is that of the nearest ideal pixel, as in `distort_labels`.  Without a lens it is
    returned unchanged.

    Parameters
    ----------
    confidence : H x W, on the ideal grid
    lens : length 8, as `read_lens` gives it (equations L1 and L2 of `lens`)
    """
    if is_straight(lens):
        return confidence
    return confidence[nearest_ideal(lens, confidence.shape)]


distort_confidence.opencl(grid="H W", lanes="rows")
distort_confidence.idle(is_straight)
