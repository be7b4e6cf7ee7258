"""A film without some of what calibration found of it, for ablations."""

from __future__ import annotations

from typing import Literal

from tactograph.graph import node
from tactograph.nodes import Film
from tactograph.nodes.light._film import matt_film

PARTS = {
    "diffuse": ("diffuse", "gain"),
    "lobe": ("base", "roughness", "refraction"),
    "harmonics": ("harmonics",),
    "bounce": ("albedo",),
    "camera": ("camera",),
}
"""The fields that make up each part of equation F1 (`_film`)."""


@node
def simplify_film(
    film: Film,
    *,
    without: tuple[Literal["diffuse", "lobe", "harmonics", "bounce", "camera"], ...] = (),
) -> Film:
    """Return the film with parts of equation F1 (`light/_film`) switched off, nothing refitted.

    What one part explained, no other part takes over: that shows what a graph owes to it.
    What a model without it could do at best, a calibration shows that does not try it
    (``--set model.without=diffuse``).

    Parameters
    ----------
    film
        The LEDs' and the film's properties.
    without
        ``diffuse`` (with the gain of touched film), ``lobe``, ``harmonics``, ``bounce``,
        ``camera``.
    """
    matt = matt_film(film.lights)
    off = {name: getattr(matt, name) for part in without for name in PARTS[part]}
    return film._replace(**off)
