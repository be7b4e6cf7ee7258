"""Convert a true height to the height above the film at rest, which graphs measure."""

from tactograph.graph import node
from tactograph.nodes import Height, Lens, RestHeight
from tactograph.nodes.height.distort_height import distort_height


@node
def truth_above_rest(
    lens: Lens,
    truth: Height | None = None,
    own_rest: Height | None = None,
    rest: RestHeight | None = None,
) -> Height | None:
    """Return the true height above the film at rest, or None without truth.

    Parameters
    ----------
    lens : length 8, from `read_lens`
    truth : H x W in mm, the absolute height of the film that each pixel of the camera sees
    own_rest : H x W in mm, the true film at rest; None: the calibration's
    rest : R x C in mm on the ideal grid, the calibration's film at rest; None: a plane at 0
    """
    if truth is None:
        return None
    if own_rest is not None:
        return truth - own_rest
    return truth if rest is None else truth - distort_height(rest, lens)
