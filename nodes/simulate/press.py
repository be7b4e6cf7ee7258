"""Press an object into the film and compute the film's surface."""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge, Interval

from tactograph.graph import Close, InputError, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, Height, PixelSize
from tactograph.nodes.simulate._gaussian import launch_smoothed, smoothed

MAX_REMAINING_ERROR = 1e-6
"""Largest share of an initial error that remains after the sweeps."""
MAX_REACH_PX = 1000.0
"""Beyond this the sweeps take minutes, and no film in the picture returns to rest."""
MIN_REACH_PX = 0.01
"""Below this the neighbour of a touched pixel stays at rest to four digits: nothing to solve."""


class _Sweeps(NamedTuple):
    """Over-relaxation: number of sweeps, weight of the neighbours, and relaxation factor."""

    number: int
    share: np.float32
    relax: np.float32


@node(
    neutral="object",
    tolerance=Close(1e-5, 1e-5, why="hundreds of dependent sweeps, each rounded"),
)
def press(
    object: Height,
    pixel: PixelSize,
    *,
    stand_off_mm: Annotated[float, Ge(0)] = 0.0,
    reach_mm: Annotated[float, Interval(ge=0, le=20)] = 0.5,
    skin_mm: Annotated[float, Interval(ge=0, le=5)] = 0.1,
) -> Height:
    r"""Return the surface of a film into which an object is pressed from behind.

    The film is a membrane of tension T on an elastic layer of stiffness k.  It takes the
    shape that minimises  integral of T/2 |grad z|^2 + k/2 z^2  and does not cut the object:
    z >= h - stand-off.  Away from the contact it returns to rest as exp(-d / reach),
    reach = sqrt(T / k).  The solver is projected successive over-relaxation with red and black
    pixels in turn; the film is level at the image's border.  A skin of finite thickness then
    rounds the remaining kinks.

    Parameters
    ----------
    object : H x W, mm: its surface above its base, as a shape node returns it
    pixel : mm per pixel
    stand_off_mm
        Distance from the object's base to the film at rest: the part of the object that stays
        behind the film.  At 0 all of it is pressed in; at its full height it just touches.
    reach_mm
        Distance over which the film rises towards the contact; 0 for a film that moves only
        where it is touched.
    skin_mm : standard deviation of the Gaussian smoothing by the skin

    Raises
    ------
    InputError
        If the reach or the skin is longer than 1000 px.
    """
    obstacle = np.maximum(object - np.float32(stand_off_mm), np.float32(0))
    film = _settled(obstacle, _sweeps(reach_mm / pixel))
    _check_reach("skin_mm", skin_mm / pixel)
    return smoothed(film[None], skin_mm / pixel)[0]


@press.opencl()
def _launch(launch: Launch) -> None:
    size = launch.sizes["H"], launch.sizes["W"]
    pixel, settings = launch.inputs["pixel"], launch.settings
    obstacle, film = launch.scratch(size), launch.scratch(size)
    sweeps = _sweeps(settings["reach_mm"] / pixel)
    _check_reach("skin_mm", settings["skin_mm"] / pixel)
    stand_off = settings["stand_off_mm"]
    launch.kernel("rise", size, launch.inputs["object"], obstacle, film, *size, stand_off)
    pairs = size[0], (size[1] + 1) // 2
    factors = sweeps.share, sweeps.relax
    for _ in range(sweeps.number):
        for colour in (0, 1):
            launch.kernel("settle", pairs, obstacle, film, *size, colour, *factors)
    launch_smoothed(launch, film, launch.outputs["press"], (1, *size), settings["skin_mm"] / pixel)


@press.example
def _example(rng: np.random.Generator, **_: int) -> dict[str, Any]:
    """Pixels that are not too small for the longest reach."""
    return {"pixel": float(rng.uniform(0.05, 0.2))}


def _sweeps(reach_px: float) -> _Sweeps:
    """The optimal factors for this stiffness, and the sweeps they need (Young's theory)."""
    _check_reach("reach_mm", reach_px)
    if reach_px < MIN_REACH_PX:
        return _Sweeps(0, np.float32(0), np.float32(0))
    share = 1 / (4 + 1 / reach_px**2)
    relax = 2 / (1 + math.sqrt(1 - (4 * share) ** 2))
    # An error shrinks by relax - 1 each sweep; the first few find where the contact ends.
    number = 10 + math.ceil(math.log(MAX_REMAINING_ERROR) / math.log(relax - 1))
    return _Sweeps(number, np.float32(share), np.float32(relax))


def _check_reach(name: str, reach_px: float) -> None:
    if reach_px > MAX_REACH_PX:
        raise InputError(
            f"press: {name} is {reach_px:.3g} px, at most {MAX_REACH_PX:g} can be computed; "
            "make it shorter or the pixels larger"
        )


def _settled(obstacle: F4, sweeps: _Sweeps) -> F4:
    film = np.pad(obstacle, 1, mode="edge")
    for _ in range(sweeps.number):
        for start in ((0, 0), (1, 1), (0, 1), (1, 0)):
            _settle(film, obstacle, start, sweeps)
    return film[1:-1, 1:-1]


def _settle(film: F4, obstacle: F4, start: tuple[int, int], sweeps: _Sweeps) -> None:
    """Move every second pixel of every second row; `film` has a border of one pixel."""
    rows, columns = obstacle.shape
    y, x = start

    def shifted(dy: int, dx: int) -> F4:
        return film[1 + y + dy : 1 + rows + dy : 2, 1 + x + dx : 1 + columns + dx : 2]

    middle = shifted(0, 0)
    pull = shifted(-1, 0) + shifted(1, 0) + shifted(0, -1) + shifted(0, 1)
    middle[:] = np.maximum(
        middle + sweeps.relax * (pull * sweeps.share - middle), obstacle[y::2, x::2]
    )
    film[0], film[-1] = film[1], film[-2]
    film[:, 0], film[:, -1] = film[:, 1], film[:, -2]
