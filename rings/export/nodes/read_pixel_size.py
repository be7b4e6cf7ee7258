"""The side of a pixel of a stored height map: given, or as its file or its result states it."""

from pathlib import Path

from tactograph.sdk import HeightFile, InputError, PixelSize, StoredResult, node, warn


@node
def read_pixel_size(
    captured: PixelSize | None = None, *, height: Path, mm: PixelSize | None = None
) -> PixelSize:
    """Return the pixel size of a height map in mm.

    ``.sur``, ``.tmd``, and the ``.tiff`` and ``.png`` that Tactograph writes state it
    themselves.  For the others, the ``result.json`` in the same folder states it.  Pixels that
    are not square have no size.

    Parameters
    ----------
    captured : mm per px that the height's images state, used if `mm` is not given
    height
        The height map: .npy, .tiff, .png (16 bit, with its scale), .tmd, .sur, .sdf, .x3p or .gwy.
    mm
        mm per px.  It takes precedence; a file that contradicts it raises a warning.

    Raises
    ------
    InputError
        If neither says it, a result's pixels are not square, or the file is missing or damaged.
    """
    mm = captured if mm is None else mm
    stated, where = HeightFile.read(height).pixel, height
    if stated is None:
        where, _ = result = StoredResult.beside(height)
        stated = result.pixel
    if mm is None:
        if stated is None:
            raise InputError(f"{height}: states no pixel size, nor does {where}; give `mm`=MM")
        return stated
    if stated is not None and not HeightFile.agree(mm, stated):
        warn(
            f"{where}: says {stated:.6g} mm per px, but `mm`={mm:.6g} is given and used; "
            "leave it out to use the file's"
        )
    return mm
