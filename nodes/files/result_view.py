"""The view that a result's height was seen in: ``result.json`` states lens and pupil."""

from pathlib import Path

import numpy as np

from tactograph.graph import InputError
from tactograph.nodes.files.result_file import RESULT_FILE, read_result
from tactograph.nodes.optics.lens import LENS_TERMS, is_straight
from tactograph.nodes.stream.touch import View


def view_stated(view: View) -> dict[str, object]:
    """Return what ``result.json`` states of a view; nothing of one that is plain."""
    lens, camera = view
    if (lens is None or is_straight(lens)) and not camera:
        return {}
    terms = [0.0] * len(LENS_TERMS) if lens is None else lens.tolist()
    return {"lens": terms, "camera": float(camera or 0.0)}


def read_view(height: Path) -> View:
    """Return the view of a height map, as the result in its folder states it; else a plain one.

    A file that the result does not name has no view.

    Raises
    ------
    InputError
        If what is stated is no view.
    """
    said = read_result(height.parent)
    if "lens" not in said or height.name not in said.get("files", []):
        return View()
    try:
        lens, camera = np.array(said["lens"], np.float32), float(said["camera"])
    except (KeyError, TypeError, ValueError):
        lens, camera = np.array([np.nan]), 0.0
    if lens.shape != (len(LENS_TERMS),) or not np.isfinite([*lens, camera]).all():
        raise InputError(f"{height.parent / RESULT_FILE}: states no view; reconstruct again")
    return View(lens, camera)


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
