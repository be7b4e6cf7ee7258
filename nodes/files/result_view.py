"""The view that a stored height was seen in: files that hold heights state lens and pupil."""

from pathlib import Path

from tactograph.graph import InputError
from tactograph.nodes.files.result_file import RESULT_FILE, read_result
from tactograph.nodes.optics.camera_view import View


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
        View.stated_in(result, height.parent / RESULT_FILE)
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
