"""Remove parts of a calibrated film model, for ablations."""

from tactograph.graph import node
from tactograph.nodes import Film
from tactograph.nodes.optics.film import FilmPart

PART_FIELDS: dict[FilmPart, tuple[str, ...]] = {
    "aim": ("aim",),
    "diffuse": ("diffuse", "gain", "wrap"),
    "lobe": ("base", "roughness", "refraction"),
    "harmonics": ("harmonics",),
    "bounce": ("albedo",),
    "camera": ("camera",),
}
"""The fields that make up each part of equation F1 (`film`)."""


@node
def simplify_film(film: Film, *, without: tuple[FilmPart, ...] = ()) -> Film:
    """Return the film with parts of equation F1 (`optics/film`) switched off.

    Nothing is refitted, so the result shows what the part contributes.  To find out how well a
    model without the part performs, calibrate without it (``--set model.without=diffuse``).

    Parameters
    ----------
    film : the LEDs' and the film's properties
    without
        ``aim``, ``diffuse`` (with the gain of touched film), ``lobe``, ``harmonics``, ``bounce``,
        ``camera``.
    """
    matt = Film.matt(film.lights)
    off = {name: getattr(matt, name) for part in without for name in PART_FIELDS[part]}
    return film._replace(**off)
