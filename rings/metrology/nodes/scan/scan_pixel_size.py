"""The side of a pixel on the film, from the user, the scan or its light model."""

from tactograph.sdk import HeightFile, PixelSize, node, warn


@node
def scan_pixel_size(
    model: PixelSize,
    stated: PixelSize | None = None,
    *,
    mm: PixelSize | None = None,
) -> PixelSize:
    """Return the pixel size that a scan states, and warn where its light model has another.

    Parameters
    ----------
    model : mm per px, of the light model
    stated : mm per px, of the scan itself; not given where it states none
    mm : mm per px, which settles it
    """
    if mm is not None or stated is None:
        return mm or model
    if not HeightFile.agree(stated, model):
        warn(
            f"the scan says {stated:.6g} mm per px, its light model {model:.6g}: the scan's is "
            "taken; check that the model is this sensor's, or settle it by `mm`=MM"
        )
    return stated
