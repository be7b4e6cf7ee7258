"""Write a touch: arrays for programs, pictures for people, and the provenance."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

from tactograph.graph import InputError, Provenance, node, warn
from tactograph.nodes import Metrics
from tactograph.nodes.files.result_file import RESULT_FILE
from tactograph.nodes.files.stored_result import StoredResult
from tactograph.nodes.optics.camera_view import View
from tactograph.nodes.stream.touch import Touch

OWN_FILES = "height.ply", "height.png"
"""Files that one result has and another lacks, besides those of layers."""


@node
def write_result(
    touch: Touch,
    metrics: Metrics | None = None,
    *,
    folder: Path,
    grid: Literal["pixel", "metric"] = "pixel",
    ply: bool = False,
    pictures: bool = True,
    provenance: Provenance,
) -> None:
    """Write the result of one touch into `folder`, or its subfolder of the touch's name.

    ``height.npy`` and ``height.tiff`` (float32, mm), ``height.png`` for people,
    ``result.json``.  Of every layer of the touch: ``NAME.npy``, drawn in ``NAME.png``, or
    ``NAME.png`` (whole numbers; flags as 0 and 255).  Numbers look black, so beside them is a
    picture for people, ``NAME_view.png``.  So ``shadow.png`` has bit k-1 set where LED k does not
    light the pixel, ``contact.png`` holds the contact's number (0: none), ``error.npy`` mm,
    ``unresolved.png`` 255 where light does not determine the height.

    ``result.json`` names these files, and a checksum of each but itself (CRC-32): a kill while
    files are moved leaves one that does not match them, and `read_height` refuses it.  Files of an
    earlier ``result.json`` in the folder that this result lacks are removed.

    Parameters
    ----------
    touch : from `join_touch`; its height is H x W in mm
    metrics : further figures for ``result.json``, such as errors against a truth
    folder : created if needed
    grid
        "pixel": ``height.npy`` is what each pixel of the camera sees.  "metric": height and
        error are on a regular grid on the film with the spacing of the pixels, of the image's
        size and about its middle; NaN at the border where no pixel sees the film.  Other layers
        stay those of the pixels.
    ply
        Whether to write ``height.ply``, a mesh in mm (x right, y up, z to the camera), about ten
        times as large as ``height.npy``.
    pictures : whether to write these; they take longer than all the rest

    Raises
    ------
    InputError
        If the folder cannot be written, or the film rises to the camera; then no file of this
        touch is written.
    """
    for layer in touch.each_layer():
        if layer.kind.warning and (doubt := layer.kind.warning(touch, layer.value)):
            warn(doubt)
    if grid == "metric":
        if touch.view.camera and touch.rest is not None:
            raise InputError(
                "`grid`=metric: the film is no plane at rest, and seen from near its places are "
                "not those of a plane; export a mesh with its calibration"
            )
        touch = _on_even_grid(touch)
    place = folder / touch.name if touch.name else folder
    about = {
        **provenance.as_dict(),
        "capture": touch.name,
        "grid": grid,
        "pixel_size_mm": float(touch.pixel),
        "pixel_sides_mm": touch.view.pixel_sides(float(touch.pixel)),
        **touch.view.stated(),
        "metrics": {**(metrics or {}), **(touch.metrics or {})},
    }
    with StoredResult.new_files(place, about, _optional_files(place)) as target:
        StoredResult.write_touch(touch, target, ply=ply, pictures=pictures)


def _on_even_grid(touch: Touch) -> Touch:
    """Return a touch whose height, and layers that follow it, are on a regular grid on the film."""
    moved = [layer for layer in touch.each_layer() if layer.kind.follows_film]
    others = [layer.value for layer in moved]
    low = [] if touch.rest is None else [touch.rest]
    height, maps = touch.view.on_even_grid(touch.height, [*low, *others])
    rest = maps.pop(0) if low else None
    resampled = {layer.name: plane for layer, plane in zip(moved, maps, strict=True)}
    layers = {**touch.layers, **resampled}
    return replace(touch, height=height, view=View(), layers=layers, rest=rest)


def _optional_files(folder: Path) -> set[str]:
    """Return the files of an earlier result that this one may lack; none without such a result."""
    stored = StoredResult.beside(folder / RESULT_FILE)
    named = stored.about.get("files")
    if not isinstance(named, list):
        return set()
    return {*OWN_FILES}.intersection(named).union(*stored.layers.values())
