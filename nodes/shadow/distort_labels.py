"""Bring labels from the ideal grid back to the camera's pixels."""

from tactograph.graph import Close, node
from tactograph.nodes import Labels, Lens
from tactograph.nodes.optics.lens import is_straight, nearest_ideal


@node(
    neutral="labels",
    tolerance=Close(share=1e-3, why="rounding of places half-way between two pixels"),
)
def distort_labels(labels: Labels, lens: Lens) -> Labels:
    """Return the labels at each pixel of the camera: those of the nearest ideal pixel.

    Pixels that look beyond the ideal grid repeat its border.  Without a lens the labels are
    returned unchanged.

    Parameters
    ----------
    labels : H x W, a bit per LED, on the ideal grid
    lens : length 8, from `read_lens` (equations L1 and L2)
    """
    if is_straight(lens):
        return labels
    return labels[nearest_ideal(lens, labels.shape)]


distort_labels.opencl(grid="H W", lanes="rows")
distort_labels.idle(is_straight)
