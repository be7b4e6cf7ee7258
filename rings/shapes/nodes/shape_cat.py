"""A sitting cat, seen from the front and lying on its back, half sunk into the plane."""

from tactograph.rings.shapes.nodes._solid import (
    Solid,
    curve,
    ellipsoid,
    relief,
    tube,
    union,
    without,
)
from tactograph.rings.shapes.profiles import stretched
from tactograph.sdk import Length, Shape, ShapeImage, node

# The model's own unit is the radius of the head; y points down, from the ears to the paws.
CAT_LENGTH = 4.5
CAT_TOP = 1.4
SURFACE_ACCURACY = 5e-4


@node
def shape_cat(
    *,
    length_mm: Length = 15.0,
    rise_mm: Length | None = None,
    angle_deg: float = 0.0,
    image: ShapeImage,
) -> Shape:
    """Return the height of a sitting cat (the kind of object of figure 8).

    Head, ears, face, belly, legs and tail are smooth solids, joined with rounded seams.

    Parameters
    ----------
    length_mm : from the tips of the ears to the paws
    rise_mm
        Height of the highest point; heights are stretched or flattened to it.  By default
        the cat keeps its proportions.
    angle_deg : turns the cat from x (right) towards y (down)
    """
    x, y = image.places(angle_deg)
    unit = length_mm / CAT_LENGTH
    height = relief(_cat(), x / unit, y / unit, CAT_TOP, SURFACE_ACCURACY)
    return Shape.of(stretched(height * unit, rise_mm), image.pixel_size_mm)


def _cat() -> Solid:
    return union([_body(), _head(), _tail()], blend=0.12)


def _head() -> Solid:
    skull = ellipsoid((0.0, -1.1, 0.1), (0.95, 0.78, 0.85))
    cheeks = ellipsoid((0.0, -0.85, 0.35), (0.8, 0.42, 0.6))
    ears = union([_ear(-1.0), _ear(1.0)])
    head = union([union([skull, cheeks], blend=0.15), ears], blend=0.1)
    head = without(head, union([_eye(-1.0), _eye(1.0)]), blend=0.05)
    return union([head, _muzzle()], blend=0.04)


def _ear(side: float) -> Solid:
    cone = tube([(0.55 * side, -1.5, 0.15), (0.76 * side, -2.16, 0.1)], [0.36, 0.05])
    hollow = tube([(0.57 * side, -1.55, 0.5), (0.73 * side, -2.0, 0.26)], [0.2, 0.04])
    return without(cone, hollow, blend=0.05)


def _eye(side: float) -> Solid:
    return ellipsoid((0.37 * side, -1.2, 0.95), (0.17, 0.12, 0.2))


def _muzzle() -> Solid:
    lips = union([ellipsoid((0.15 * side, -0.82, 0.88), (0.2, 0.15, 0.2)) for side in (-1.0, 1.0)])
    nose = ellipsoid((0.0, -0.97, 1.0), (0.1, 0.07, 0.12))
    return union([lips, nose], blend=0.02)


def _body() -> Solid:
    chest = ellipsoid((0.0, 0.3, 0.0), (0.85, 1.15, 0.75))
    haunches = union(
        [ellipsoid((0.68 * side, 1.35, 0.15), (0.62, 0.82, 0.75)) for side in (-1.0, 1.0)]
    )
    trunk = union([chest, haunches], blend=0.35)
    return union([trunk, _leg(-1.0), _leg(1.0), _foot(-1.0), _foot(1.0)], blend=0.08)


def _leg(side: float) -> Solid:
    path = [(0.3 * side, 0.4, 0.6), (0.28 * side, 1.85, 0.72), (0.3 * side, 2.0, 0.85)]
    return tube(path, [0.24, 0.2, 0.25])


def _foot(side: float) -> Solid:
    return ellipsoid((0.85 * side, 2.02, 0.5), (0.42, 0.22, 0.5))


def _tail() -> Solid:
    sweep = [(1.0, 1.95, 0.1), (2.35, 2.2, 0.2), (2.1, 0.7, 0.3), (1.7, 0.2, 0.2)]
    return tube(curve(sweep, pieces=20), [0.25, 0.17])
