"""Measure flat punches of known depth: what walls lose, and how far plateaus are off."""

from typing import Annotated

import cv2
import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from tactograph.rings.oneshot.nodes.map.map_error import map_error
from tactograph.rings.oneshot.nodes.map.raise_walls import edge_lack, uphill
from tactograph.rings.oneshot.nodes.map.reflectance_map import ReflectanceMap
from tactograph.rings.oneshot.nodes.map.slope_in_shadow import matt_deviation
from tactograph.rings.oneshot.nodes.presses import PressImages
from tactograph.rings.oneshot.nodes.presses.fit_reflectance_map import Bench
from tactograph.sdk import F4, F8, Height, InputError, Judged, Light, PixelSize, Port, node
from tactograph.sdk.nodes import coarsen, find_contact, integrate_dct, rest_at_border


@node
def judge_punches(
    image: PressImages,
    flat: Light,
    names: list[str],
    reflectance: ReflectanceMap,
    residual: Annotated[F4, Port("K", "1")],
    pixel: PixelSize,
    of_radius: Judged | None = None,
    *,
    depth_mm: tuple[Annotated[float, Gt(0)], ...] | None = None,
) -> Judged:
    """Return how far the plateaus of flat punches are from their depths, and the gain of walls.

    A plateau is level, so walls alone carry its height.  One punch is a check.  Of two or more,
    the gain of `raise_walls` is that by which plateaus come closest to their depths, each held
    out in turn; it is kept if what is held out then lies closer than without.

    Parameters
    ----------
    image, flat : P x K x H x W punches, levelled, and the K x H x W film at rest
    names : the punches' names, for messages.  No names mean that there is none.
    reflectance, residual : as `fit_reflectance_map` returns them
    pixel : mm per px
    of_radius : what `judge_radius` says of the film
    depth_mm : how deep punches are pressed in, all alike, or one each in order of their names

    Returns
    -------
    ``punches``; ``punch_um``, root mean square distance of plateaus from their depths, held out
    from two punches on, and ``punch_percent``, the same of the depth; ``wall_gain`` if it is kept.
    A doubt if a plateau is farther off than chance takes the worst of valid ones, normally
    distributed by their stated deviations.

    Raises
    ------
    InputError
        If depths and punches differ in number, or a punch shows no contact.
    """
    if not names:
        return Judged({}, [])
    stated = np.asarray(depth_mm or (), float)
    if stated.size not in (1, len(names)):
        raise InputError(
            f"{stated.size} depths for {len(names)} punches: give `depth_mm`=MM, one for all or "
            "one each in order of the folders' names"
        )
    depths = np.broadcast_to(stated, len(names))
    bench = Bench.of(image, flat, 1.0, pixel, 0)
    departure = float(residual.max())
    misfit = np.array([0, 0, departure, 0, 0], np.float32)
    matt = matt_deviation(of_radius.quality, departure) if of_radius else 0.0
    tops = []
    for press, name in enumerate(names):
        slope, height = bench.reconstruct(reflectance.astype(np.float64), press, matt)
        cells = coarsen(bench.light[press])
        error = map_error(height, slope, cells, reflectance, misfit, pixel)
        lack = rest_at_border(integrate_dct(uphill(slope) * edge_lack(slope), pixel))
        top = _plateau(height, error, name)
        tops.append([float(np.median(plane[top])) for plane in (height, lack, error)])
    heights, lacks, errors = np.transpose(tops)
    off, gain = heights - depths, 0.0
    if len(names) > 1:
        each = [_gain(np.delete(off, i), np.delete(lacks, i)) for i in range(len(names))]
        held_out = off + np.array(each) * lacks
        if np.sum(held_out**2) < np.sum(off**2):
            off, gain = held_out, _gain(off, lacks)
    quality = {
        "punches": float(len(names)),
        "punch_um": 1e3 * float(np.sqrt(np.mean(off**2))),
        "punch_percent": 100 * float(np.sqrt(np.mean((off / depths) ** 2))),
    }
    if gain:
        quality["wall_gain"] = gain
    return Judged(quality, _doubts(names, off, errors))


def _gain(off: F8, lacks: F8) -> float:
    """By least squares; negative where shadows at their feet make walls too steep."""
    return -float(off @ lacks) / max(float(lacks @ lacks), 1e-12)


def _plateau(height: Height, error: F4, name: str) -> NDArray[np.bool_]:
    """What lies in by half of the largest width, of what stands up by half of the height."""
    contact = find_contact(height, error, enter=4.0, leave=2.0) == 1
    if not contact.any():
        raise InputError(f"punch {name}: no contact; is it in the frame, and pressed in?")
    high = contact & (2 * height > np.percentile(height[contact], 90))
    inside = cv2.distanceTransform(high.astype(np.uint8), cv2.DIST_L2, 5)
    return np.asarray(2 * inside >= inside.max())


def _doubts(names: list[str], off: F8, errors: F8) -> list[str]:
    far = np.abs(off) / errors
    worst = int(far.argmax())
    if far[worst] <= Judged.reach(far.size):
        return []
    return [
        f"the plateau of punch {names[worst]} is {1e3 * off[worst]:.0f} um off, "
        f"{far[worst]:.1f} stated deviations: check `depth_mm`, the ball's radius, and that the "
        "punch does not leave the frame"
    ]
