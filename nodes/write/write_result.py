"""Write a touch: arrays for programs, pictures for people, and the provenance."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from tactograph.graph import Provenance, node, warn
from tactograph.graph.disk.atomic_files import atomic_files
from tactograph.nodes import Mask, Metrics
from tactograph.nodes.files.height_files import write_mesh, write_tiff
from tactograph.nodes.files.image_files import write_image
from tactograph.nodes.files.result_file import RESULT_FILE, read_result, write_result_file
from tactograph.nodes.optics.film_places import on_even_grid
from tactograph.nodes.optics.lens import pixel_sides
from tactograph.nodes.stream.touch import Touch, now_in_touch
from tactograph.nodes.write.read_error import PARTS_FILE
from tactograph.rings.metrology.nodes.surface.measure_step import ErrorParts

OPTIONAL_FILES = (
    *("height.ply", "height.png", "shadow.png", "shadow_view.png", "error.npy", "error.png"),
    *("confidence.npy", "confidence.png", "highlight.png", "highlight_view.png"),
    *("contact.png", "contact_view.png", "unresolved.png"),
    PARTS_FILE,
)
"""Files that one result has and another lacks."""


@node(
    former=now_in_touch(
        *("height", "shadow", "image", "pixel", "name", "error", "highlight", "confidence"),
        *("lens", "camera", "contact"),
    )
)
def write_result(
    touch: Touch,
    metrics: Metrics | None = None,
    unresolved: Mask | None = None,
    parts: ErrorParts | None = None,
    *,
    folder: Path,
    grid: Literal["pixel", "metric"] = "pixel",
    mesh: bool = True,
    pictures: bool = True,
    provenance: Provenance,
) -> None:
    """Write the result of one touch into `folder`, or its subfolder of the touch's name.

    ``height.npy`` and ``height.tiff`` (float32, mm), ``height.ply`` (a mesh in mm, x right,
    y up, z to the camera), ``height.png`` for people, ``result.json``.  Of what else the touch
    holds: ``shadow.png`` (bit k-1 set where LED k does not light the pixel), ``highlight.png``
    (bits as in ``shadow.png``), ``contact.png`` (8 bit, the contact's number, 0: none),
    ``error.npy`` and ``error.png``, ``confidence.npy`` (float32, 0 to 1) and
    ``confidence.png``; ``unresolved.png`` (8 bit, 255 where an edge leaves the height open).
    ``shadow.png``, ``highlight.png`` and ``contact.png`` hold numbers and
    look black; beside each is a picture of them for people, ``shadow_view.png`` and so on.

    ``result.json`` names these files, and a checksum of each but itself (CRC-32): a kill while
    files are moved leaves one that does not match them, and `read_height` tells.  Files that an
    earlier ``result.json`` in the folder names, and that this result lacks, are removed.

    Parameters
    ----------
    touch : as `join_touch` makes it
    metrics : further figures for ``result.json``, such as errors against a truth
    unresolved : H x W, as `unresolved_edges` gives it
    parts : of the error where a known step settled the scale, ``error_parts.npy``
    folder : created if needed
    grid
        "pixel": ``height.npy`` is what each pixel of the camera sees.  "metric": height and
        error are on a regular grid on the film with the spacing of the pixels, of the image's
        size and about its middle; NaN at the border where no pixel sees the film.  Labels,
        contacts and confidence stay those of the pixels.
    mesh, pictures : whether to write these, too; they take longer than all the rest

    Raises
    ------
    InputError
        If the folder cannot be written, or the film rises to the camera; then no file of this
        touch is written.
    """
    _warn_of_three_lights(touch)
    if grid == "metric":
        touch = _on_even_grid(touch)
    place = folder / touch.name if touch.name else folder
    with atomic_files(place, last=RESULT_FILE, instead_of=_optional_files(place)) as target:
        _write_arrays(touch, target)
        if unresolved is not None:
            write_image(target / "unresolved.png", unresolved * np.uint8(255))
        if parts is not None:
            np.save(target / PARTS_FILE, parts)
        if mesh:
            file, camera = target / "height.ply", touch.camera or 0.0
            write_mesh(file, touch.height, touch.pixel, touch.lens, camera)
        if pictures:
            _draw(touch, target)
        about = {
            **provenance.as_dict(),
            "capture": touch.name,
            "grid": grid,
            "pixel_size_mm": float(touch.pixel),
            "pixel_sides_mm": pixel_sides(touch.lens, float(touch.pixel)),
            "metrics": {**(metrics or {}), **(touch.metrics or {})},
        }
        write_result_file(target, about)


def _warn_of_three_lights(touch: Touch) -> None:
    """Warn where one LED of three is in shadow: two lights allow two slopes."""
    if len(touch.image) == 3 and touch.shadow is not None and touch.shadow.any():
        share = np.mean(touch.shadow != 0)
        # 'precise' takes calibrations of LEDs whose places are known; they know the pupil's, too.
        cure = "press less steeply" if touch.camera is None else "a fourth LED, or 'precise', helps"
        warn(
            f"three lights, {share:.1%} of the pixels in shadow: two lights allow two slopes, so "
            f"heights there and beyond may be wrong; {cure}"
        )


def _on_even_grid(touch: Touch) -> Touch:
    """Return a touch whose height and error are on a regular grid on the film."""
    others = [] if touch.error is None else [touch.error]
    height, known = on_even_grid(touch.height, others, touch.lens, touch.camera or 0.0)
    error = known[0] if known else None
    return replace(touch, height=height, error=error, lens=None, camera=None)


def _optional_files(folder: Path) -> set[str]:
    """Return the files of an earlier result that this one may lack; none without such a result."""
    named = read_result(folder).get("files")
    return {*OPTIONAL_FILES} & {*named} if isinstance(named, list) else set()


def _write_arrays(touch: Touch, folder: Path) -> None:
    """Write measurements as floats, labels as images of 8 bits."""
    measured = {"height": touch.height, "error": touch.error, "confidence": touch.confidence}
    labels = {"shadow": touch.shadow, "highlight": touch.highlight, "contact": touch.contact}
    write_tiff(folder / "height.tiff", touch.height, *pixel_sides(touch.lens, touch.pixel))
    for name, plane in measured.items():
        if plane is not None:
            np.save(folder / f"{name}.npy", plane)
    for name, numbers in labels.items():
        if numbers is not None:
            write_image(folder / f"{name}.png", numbers)


def _draw(touch: Touch, folder: Path) -> None:
    """Draw every measurement, and all labels over the image."""
    # Loading Matplotlib takes longer than computing a touch.
    from tactograph.nodes.drawing import result_pictures as pictures

    measured = {
        "error": (touch.error, pictures.draw_error),
        "confidence": (touch.confidence, pictures.draw_confidence),
    }
    labels = {
        "shadow": (touch.shadow, pictures.draw_shadow),
        "highlight": (touch.highlight, pictures.draw_highlight),
        "contact": (touch.contact, pictures.draw_contact),
    }
    pictures.draw_height(touch.height, touch.error, touch.pixel, folder / "height.png")
    for name, (plane, draw) in measured.items():
        if plane is not None:
            draw(plane, touch.pixel, folder / f"{name}.png")
    for name, (numbers, draw_over) in labels.items():
        if numbers is not None:
            draw_over(numbers, touch.image, folder / f"{name}_view.png")
