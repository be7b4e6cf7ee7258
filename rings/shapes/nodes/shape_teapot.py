"""A teapot lying on its side, half sunk into the plane."""

from tactograph.rings.shapes.nodes._solid import Solid, curve, ellipsoid, relief, tube, union
from tactograph.rings.shapes.profiles import stretched
from tactograph.sdk import Length, Shape, ShapeImage, node

# The model's own unit is the belly's radius; y points down, from the lid to the foot.
TEAPOT_LENGTH = 3.88
TEAPOT_TOP = 1.1
SURFACE_ACCURACY = 5e-4


@node
def shape_teapot(
    *,
    length_mm: Length = 17.0,
    rise_mm: Length | None = None,
    angle_deg: float = 0.0,
    image: ShapeImage,
) -> Shape:
    """Return the height of a teapot in profile (the object of figure 7).

    Belly, lid, knob, spout, handle and foot are smooth solids, joined with rounded seams;
    half of the pot stands above the plane.

    Parameters
    ----------
    length_mm : from the tip of the spout to the back of the handle
    rise_mm
        Height of the highest point; heights are stretched or flattened to it.  By default
        the pot keeps its proportions.
    angle_deg : turns the pot from x (right) towards y (down)
    """
    x, y = image.places(angle_deg)
    unit = length_mm / TEAPOT_LENGTH
    height = relief(_teapot(), x / unit, y / unit, TEAPOT_TOP, SURFACE_ACCURACY)
    return Shape.of(stretched(height * unit, rise_mm), image.pixel_size_mm)


def _teapot() -> Solid:
    pot = union([_belly(), _spout()], blend=0.18)
    return union([pot, _handle(), _lid()], blend=0.06)


def _belly() -> Solid:
    bowl = ellipsoid((0.0, 0.0, 0.0), (1.0, 0.78, 1.0))
    foot = ellipsoid((0.0, 0.72, 0.0), (0.58, 0.12, 0.58))
    return union([bowl, foot], blend=0.1)


def _lid() -> Solid:
    rim = ellipsoid((0.0, -0.68, 0.0), (0.56, 0.07, 0.56))
    dome = ellipsoid((0.0, -0.72, 0.0), (0.46, 0.2, 0.46))
    knob = ellipsoid((0.0, -1.03, 0.0), (0.14, 0.13, 0.14))
    return union([rim, union([dome, knob], blend=0.08)], blend=0.03)


def _spout() -> Solid:
    bend = [(0.7, 0.35, 0.0), (1.5, 0.35, 0.0), (1.3, -0.45, 0.0), (1.85, -0.62, 0.0)]
    return tube(curve(bend, pieces=24), [0.34, 0.25, 0.18, 0.14, 0.15])


def _handle() -> Solid:
    bow = [(-0.75, -0.5, 0.0), (-2.1, -0.85, 0.0), (-2.15, 0.75, 0.0), (-0.8, 0.42, 0.0)]
    return tube(curve(bow, pieces=20), [0.13, 0.11])
