"""Read the view that a stored height map was seen in."""

from pathlib import Path

from tactograph.sdk import StoredResult, View, node


@node
def read_result_view(*, height: Path) -> View:
    """Read the lens and the camera's pupil that the ``result.json`` beside a height map states.

    Parameters
    ----------
    height : the file of the height map

    Raises
    ------
    InputError
        If what it states is no view.
    """
    return StoredResult.beside(height).view(height)
