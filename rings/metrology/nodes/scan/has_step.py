"""Whether a scan is given whose step is known."""

from pathlib import Path

from tactograph.rings.metrology.nodes.filled.scale_height import Scale
from tactograph.rings.metrology.nodes.surface.measure_step import CertifiedDepth
from tactograph.sdk import InputError, node


@node
def has_step(
    *,
    folder: Path | None = None,
    certified_um: CertifiedDepth | None = None,
    scale: Scale | None = None,
) -> bool:
    """Return whether there is a known step, and refuse one that is half given.

    Parameters
    ----------
    folder : a scan of the step; None: there is none
    certified_um : certified depth and standard uncertainty, as for `measure_step`
    scale : factor and its uncertainty, as for `scale_height`

    Raises
    ------
    InputError
        If scan and depth are not given together, or a scale as well.
    """
    if (folder is None) != (certified_um is None):
        raise InputError("a known step needs both: `folder`=SCAN `certified_um`=DEPTH,UNCERTAINTY")
    if folder is not None and scale is not None:
        raise InputError(f"{folder}: a known step tells the scale: give `folder` or `scale`")
    return folder is not None
