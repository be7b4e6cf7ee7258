"""The pixel size of a film that is a plane at rest."""

from typing import Annotated, NamedTuple

from tactograph.sdk import F4, InputError, PixelSize, Port, node


class FilmPixel(NamedTuple):
    """Of a calibration: the pixel size, and the film at rest where it is no plane."""

    pixel_size: PixelSize
    rest: Annotated[F4, Port("R C", "mm")] | None = None


@node
def plane_pixel(film: FilmPixel, *, what: str) -> PixelSize:
    """Return the pixel size, for what holds on a film alone that is a plane at rest.

    Parameters
    ----------
    film : the calibration
    what : what is asked for, for the message

    Raises
    ------
    InputError
        If the film is no plane at rest.
    """
    if film.rest is not None:
        raise InputError(
            f"the film of this calibration is no plane at rest, for which {what} takes it: heights "
            "above it come from reconstruct, precise and paper"
        )
    return film.pixel_size
