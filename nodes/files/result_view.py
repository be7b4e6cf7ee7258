"""The view that a stored height was seen in: files that hold heights state lens and pupil."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tactograph.graph import InputError
from tactograph.nodes.files.result_file import RESULT_FILE, read_result
from tactograph.nodes.optics.lens import LENS_TERMS, is_straight
from tactograph.nodes.stream.touch import View


def view_stated(view: View) -> dict[str, object]:
    """Return what a file states of a view, for `view_in`; nothing of one that is plain."""
    lens, camera = view
    if (lens is None or is_straight(lens)) and not camera:
        return {}
    terms = [0.0] * len(LENS_TERMS) if lens is None else lens.tolist()
    return {"lens": terms, "camera": float(camera or 0.0)}


def view_in(header: Mapping[str, Any], file: Path) -> View:
    """Return the view that a file states; a plain one if it states none.

    Raises
    ------
    InputError
        If what is stated is no view.
    """
    if "lens" not in header:
        return View()
    try:
        lens, camera = np.array(header["lens"], np.float32), float(header["camera"])
    except (KeyError, TypeError, ValueError):
        lens, camera = np.array([np.nan]), 0.0
    if lens.shape != (len(LENS_TERMS),) or not np.isfinite([*lens, camera]).all():
        raise InputError(f"{file}: states no view; reconstruct again")
    return View(lens, camera)


def read_view(height: Path) -> View:
    """Return the view of a height map, as the result in its folder states it; else a plain one.

    A file that the result does not name has no view.

    Raises
    ------
    InputError
        If what is stated is no view.
    """
    result = read_result(height.parent)
    return (
        view_in(result, height.parent / RESULT_FILE)
        if height.name in result.get("files", [])
        else View()
    )


def refuse_view(height: Path) -> None:
    """Refuse a height map whose pixels do not see the film on an even grid.

    Raises
    ------
    InputError
        If the result in its folder states a lens, or a camera's pupil.
    """
    if read_view(height).lens is not None:
        raise InputError(
            f"{height}: is as its camera sees it, by a lens or from near, not on an even grid; "
            "reconstruct with --set save.grid=metric"
        )
