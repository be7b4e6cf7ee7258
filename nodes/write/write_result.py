"""Write a touch: arrays for programs, pictures for people, and the provenance."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

import numpy as np

from tactograph.graph import Provenance, node, warn
from tactograph.graph.disk.atomic_files import atomic_files
from tactograph.nodes import (
    Confidence,
    Contacts,
    Height,
    HeightError,
    Labels,
    Lens,
    Light,
    Metrics,
    PixelSize,
    Vergence,
)
from tactograph.nodes.files.height_files import write_mesh, write_tiff
from tactograph.nodes.files.image_files import write_image
from tactograph.nodes.files.result_file import RESULT, checksum, read_result
from tactograph.nodes.optics.film_places import on_even_grid

FEWEST = 3
"""With this many LEDs a shadow leaves two, and two lights allow two slopes."""
SOMETIMES = (
    *("height.ply", "height.png", "shadow_view.png", "error.npy", "error.png"),
    *("confidence.npy", "confidence.png", "highlight.png", "highlight_view.png"),
    *("contact.png", "contact_view.png"),
)
"""Files that one result has and another lacks."""


@node
def write_result(
    height: Height,
    shadow: Labels,
    image: Light,
    pixel: PixelSize,
    metrics: Metrics,
    name: str,
    error: HeightError | None = None,
    highlight: Labels | None = None,
    confidence: Confidence | None = None,
    lens: Lens | None = None,
    camera: Vergence | None = None,
    contact: Contacts | None = None,
    *,
    folder: Path,
    grid: Literal["pixel", "metric"] = "pixel",
    mesh: bool = True,
    pictures: bool = True,
    provenance: Provenance,
) -> None:
    """Write the result of one touch into `folder`, or its subfolder of the touch's name.

    ``height.npy`` and ``height.tiff`` (float32, mm), ``height.ply`` (a mesh in mm, x right,
    y up, z to the camera), ``shadow.png`` (bit k-1 set where LED k does not light the
    pixel), ``height.png`` for people, ``result.json``; with an error ``error.npy`` and
    ``error.png`` too, with highlights ``highlight.png`` (bits as in ``shadow.png``), with a
    confidence ``confidence.npy`` (float32, 0 to 1) and ``confidence.png``, with contacts
    ``contact.png`` (8 bit, the contact's number, 0: none).  ``shadow.png``, ``highlight.png``
    and ``contact.png`` hold numbers and look black; beside each is a picture of them for
    people, ``shadow_view.png`` and so on.

    ``result.json`` names these files, and a checksum of each but itself (CRC-32): a kill while
    files are moved leaves one that does not match them, and `read_height` tells.  Files that an
    earlier ``result.json`` in the folder names, and that this result lacks, are removed.

    Parameters
    ----------
    height
        H x W in mm.
    shadow
        H x W, the shadowed LEDs.
    image
        K x H x W, as captured; the background of ``shadow_view.png`` and similar pictures.
    pixel
        mm per px.
    metrics
        Figures to keep in ``result.json``.
    name
        The capture's name in a stream; empty for a single capture.
    error
        H x W, the height's standard deviation in mm, where the graph knows it.
    highlight
        H x W, the LEDs that the film mirrors, where the graph looks for them.
    confidence
        H x W, the probability that the shadow labels are right, where the graph knows it.
    lens, camera
        Length 8, as `read_lens` gives it, and 1 / D in 1/mm, with D the height of the camera's
        pupil above the film (0: orthographic), where the graph knows them.  The mesh's points
        are where they lie on the film.
    contact
        H x W, the number of the contact at each pixel, where the graph looks for contacts.
    folder
        Created if needed.
    grid
        "pixel": ``height.npy`` is what each pixel of the camera sees.  "metric": height and
        error are on a regular grid on the film with spacing `pixel`, of the image's size and
        about its middle; NaN at the border where no pixel sees the film.  Labels, contacts and
        confidence stay those of the pixels.
    mesh, pictures
        Whether to write these, too; they take longer than all the rest.

    Raises
    ------
    InputError
        If the folder cannot be written, or the film rises to the camera; then no file of this
        touch is written.
    """
    if len(image) == FEWEST and shadow.any():
        share = np.mean(shadow != 0)
        warn(
            f"three LEDs, {share:.1%} of the pixels in shadow: two lights allow two slopes, so "
            "heights there and beyond may be wrong; a fourth LED, or 'precise', helps"
        )
    placed, vergence = lens, camera or 0.0
    if grid == "metric":
        height, known = on_even_grid(height, [] if error is None else [error], lens, vergence)
        error = known[0] if known else None
        placed, vergence = None, 0.0
    place = folder / name if name else folder
    earlier = _files_of(place)
    with atomic_files(place, last=RESULT, instead_of=earlier) as target:
        np.save(target / "height.npy", height)
        write_tiff(target / "height.tiff", height, pixel)
        write_image(target / "shadow.png", shadow)
        if error is not None:
            np.save(target / "error.npy", error)
        if highlight is not None:
            write_image(target / "highlight.png", highlight)
        if contact is not None:
            write_image(target / "contact.png", contact)
        if confidence is not None:
            np.save(target / "confidence.npy", confidence)
        if mesh:
            write_mesh(target / "height.ply", height, pixel, placed, vergence)
        if pictures:
            # Loading Matplotlib takes longer than computing a touch.
            from tactograph.nodes.drawing.result_pictures import (
                draw_confidence,
                draw_contact,
                draw_error,
                draw_height,
                draw_highlight,
                draw_shadow,
            )

            draw_height(height, error, pixel, target / "height.png")
            if error is not None:
                draw_error(error, pixel, target / "error.png")
            if confidence is not None:
                draw_confidence(confidence, pixel, target / "confidence.png")
            draw_shadow(shadow, image, target / "shadow_view.png")
            if highlight is not None:
                draw_highlight(highlight, image, target / "highlight_view.png")
            if contact is not None:
                draw_contact(contact, image, target / "contact_view.png")
        checksums = {file.name: checksum(file) for file in sorted(target.iterdir())}
        about = {
            **provenance.as_dict(),
            "capture": name,
            "grid": grid,
            "pixel_size_mm": float(pixel),
            "files": sorted([*checksums, RESULT]),
            "checksums": checksums,
            "metrics": metrics,
        }
        (target / RESULT).write_text(json.dumps(about, indent=1) + "\n")


def _files_of(folder: Path) -> set[str]:
    """The files of an earlier result that this one may lack; none if there is no such result."""
    named = read_result(folder).get("files")
    return {name for name in SOMETIMES if name in named} if isinstance(named, list) else set()
