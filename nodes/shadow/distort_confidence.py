"""Bring the confidence of labels from the ideal grid back to the camera's pixels."""

from tactograph.graph import Close, node
from tactograph.nodes import Confidence, Lens
from tactograph.nodes.optics.lens import is_straight, nearest_ideal


@node(
    neutral="confidence",
    tolerance=Close(share=1e-3, why="rounding of places half-way between two pixels"),
)
def distort_confidence(confidence: Confidence, lens: Lens) -> Confidence:
    """Return the confidence of the labels at each pixel of the camera.

    It is that of the nearest ideal pixel, as in `distort_labels`.  Without a lens the confidence
    is returned unchanged.

    Parameters
    ----------
    confidence : H x W, on the ideal grid
    lens : length 8, from `read_lens` (equations L1 and L2)
    """
    if is_straight(lens):
        return confidence
    return confidence[nearest_ideal(lens, confidence.shape)]


distort_confidence.opencl(grid="H W", lanes="rows")
distort_confidence.idle(is_straight)
