"""Write a surface that was put together from touches."""

from pathlib import Path

import numpy as np

from tactograph.rings.mechanics.nodes.motion.stitch import Sources, Stitched
from tactograph.sdk import ImageFile, PixelSize, Provenance, StoredResult, Touch, node


@node
def write_stitched(
    height: Stitched,
    error: Stitched,
    source: Sources,
    pixel: PixelSize,
    metrics: dict[str, float],
    *,
    folder: Path,
    ply: bool = False,
    provenance: Provenance,
) -> None:
    """Write ``height.npy``, ``error.npy``, pictures, and ``result.json`` into `folder`.

    Files are as `write_result` writes them; ``source.png`` holds the number of the touch that
    counts most at each pixel, and ``seams.png`` shows the surface with the seams between touches.

    Parameters
    ----------
    height, error : Y x X in mm; NaN where nothing touched
    source : Y x X, as `stitch` gives it
    pixel : mm per px
    metrics : figures to keep in ``result.json``
    folder : created if needed
    ply : whether to write ``height.ply``, too

    Raises
    ------
    InputError
        If the folder cannot be written; then no file is.
    """
    # Loading Matplotlib takes longer than the rest.
    from tactograph.rings.mechanics.nodes.motion._seams import draw_seams

    no_image = np.zeros((1, *height.shape), np.float32)
    touch = Touch(height, no_image, pixel, layers={"error": error})
    about = {**provenance.as_dict(), "pixel_size_mm": float(pixel), "metrics": metrics}
    with StoredResult.new_files(folder, about) as target:
        StoredResult.write_touch(touch, target, ply=ply)
        ImageFile(target / "source.png").write(source)
        draw_seams(height, source, pixel, target / "seams.png")
