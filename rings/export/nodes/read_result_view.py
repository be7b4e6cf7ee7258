"""Read the view that a stored height map was seen in."""

from pathlib import Path
from typing import NamedTuple

from tactograph.sdk import node
from tactograph.sdk.unstable import Lens, Vergence, read_view


class ResultView(NamedTuple):
    """The camera's lens and the place of its pupil; None of a height on an even grid."""

    lens: Lens | None
    camera: Vergence | None


@node
def read_result_view(*, height: Path) -> ResultView:
    """Read the lens and the camera's pupil that the ``result.json`` beside a height map states.

    Parameters
    ----------
    height : the file of the height map

    Raises
    ------
    InputError
        If what it states is no view.
    """
    return ResultView(*read_view(height))
