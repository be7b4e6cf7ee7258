"""Depth, width and wall angles of a groove, ridge or step, by ISO 5436-1.

Long because edges, levels and walls of a profile all follow from one definition of its zones.
"""

from typing import Annotated, Literal, NamedTuple

import cv2
import numpy as np
from annotated_types import Ge, Gt, Interval
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from tactograph.sdk import F4, Crop, Height, HeightError, InputError, PixelSize, Port, node, warn

MIN_PROFILES = 5
MIN_ZONE_PX = 3
"""Fewest pixels of a level that is measured."""
SMOOTH_PX = 5
"""Pixels that a profile is averaged over, to find its edges."""
WALL_SHARES = 0.2, 0.8
"""Shares of the depth between which a wall's angle is taken."""
END_SHARE = 0.05
"""Share of a profile at each end that tells its tilt: a groove's ends lie on one level."""
MAX_UNEVEN = 0.2
"""Spread of the widths, over their median, above which profiles do not show one groove."""
MAX_WALL_SHARE = 0.6
"""Widest wall, as a share of a groove's width, that leaves both levels free."""
Line = NDArray[np.float64]
ErrorParts = Annotated[F4, Port("D h w", "mm", low=-0.01, high=0.01)]
"""Errors of heights of cells, each alike wherever it is; their squares add up to the variance."""
Across = Literal["x", "y"]
"""Axis of the profiles: they cross the groove."""
EdgeCount = Annotated[int, Interval(ge=1, le=2)]
"""2: groove or ridge; 1: step."""
CertifiedDepth = tuple[Annotated[float, Gt(0)], Annotated[float, Ge(0)]]
"""Depth that is certified, and its standard uncertainty, in um."""


class Profile(NamedTuple):
    """Depth of a profile in mm (above 0: a groove, or a step down), its standard deviation,
    edges in px, walls in degrees, and what they were found by."""

    depth: float
    error: float
    edges: tuple[float, ...]
    walls: tuple[float, ...]
    x: Line
    """Places of the profile in px."""
    z: Line
    """Heights above the middle between both levels, without their common slope, in mm."""
    upper: NDArray[np.bool_]
    """The places whose heights make the first level."""
    lower: NDArray[np.bool_]


@node
def measure_step(
    height: Height,
    pixel: PixelSize,
    error: HeightError | None = None,
    parts: ErrorParts | None = None,
    *,
    along: Across = "x",
    edges: EdgeCount = 2,
    certified_um: CertifiedDepth | None = None,
) -> dict[str, float]:
    """Measure a groove (two edges) or a step (one) on every profile across it.

    Of a groove of width W, ISO 5436-1 (type A1) compares the middle third of its bottom with the
    parts of the upper level that lie from W / 3 to W beyond either edge; of a step, the parts
    from w to 3 w beyond the edge, with w the width of its wall.  Both levels share a slope: z =
    a x + b + h d, with d = 1 above and -1 below, by least squares; the depth is 2 h.

    Parameters
    ----------
    height : H x W in mm; unknown film (NaN) is left out
    pixel : mm per px
    error
        Standard deviation of the height in mm; then the uncertainty holds that of both levels.
        Without it a warning says so.
    parts : the parts of the error, on cells: then the uncertainty holds what the depth has of them
    along : axis of the profiles: they cross the groove
    edges : 2: groove or ridge; 1: step
    certified_um : depth that is certified, and its standard uncertainty, both in um

    Returns
    -------
    dict
        ``step_depth_um`` (the median over the profiles; below 0: a ridge, or a step up),
        ``step_spread_um`` (their standard deviation), ``step_uncertainty_um`` (standard
        uncertainty of the depth: the spread of the mean, and the stated error, which profiles
        share; without `parts` also what edges within a pixel may hide),
        ``step_width_mm``, ``wall_1_deg``, ``wall_2_deg`` (steepest part of the walls against the
        level), ``step_profiles``.  Of a known depth also ``step_scale``, by which heights are to
        be multiplied, and its standard uncertainty ``step_scale_error``.

    Raises
    ------
    InputError
        If too few profiles show such edges.
    """
    profiles = step_profiles(height, pixel, error, along, edges)
    if error is None:
        warn(
            "the height states no error: step_uncertainty_um is of the profiles' spread alone, and "
            "profiles share their error; precise, precise_filled and reconstruct_scan state one"
        )
    depths = 1e3 * np.array([profile.depth for profile in profiles])
    middle, spread = float(np.median(depths)), float(np.std(depths, ddof=1))
    of_mean = spread / np.sqrt(len(depths))
    stated = 1e3 * float(np.sqrt(np.mean([profile.error**2 for profile in profiles])))
    if error is not None and parts is None:
        stated = float(np.hypot(stated, 1e3 * _edge_loss(profiles, pixel)))
    if parts is not None:
        depth, *others = depths_with(parts, height, pixel, along, edges)
        stated = 1e3 * float(np.linalg.norm(np.array(others) - depth))
    figures = {
        "step_depth_um": middle,
        "step_spread_um": spread,
        "step_uncertainty_um": float(np.hypot(of_mean, stated)),
        "step_profiles": float(len(profiles)),
    }
    if edges == 2:
        widths = pixel * np.array([p.edges[1] - p.edges[0] for p in profiles])
        figures["step_width_mm"] = float(np.median(widths))
        if np.std(widths) > MAX_UNEVEN * np.median(widths):
            warn("the profiles' widths differ by a fifth: they do not cross one straight groove")
    for wall in range(edges):
        figures[f"wall_{wall + 1}_deg"] = float(np.median([p.walls[wall] for p in profiles]))
    if certified_um is not None:
        certified, uncertainty = certified_um
        if not certified > 0 or not middle:
            raise InputError(
                f"`certified_um`={certified:g},{uncertainty:g}: a depth above 0 is needed"
            )
        scale = certified / abs(middle)
        of_scale = np.hypot(of_mean / middle, uncertainty / certified)
        figures |= {"step_scale": scale, "step_scale_error": scale * float(of_scale)}
    _warn_of_wide_walls(figures)
    return figures


def step_profiles(
    height: Height,
    pixel: float,
    error: HeightError | None,
    along: str,
    edges: int,
    smooth_px: int = SMOOTH_PX,
) -> list[Profile]:
    """Every profile that shows such edges; the arguments are those of `measure_step`.

    Raises
    ------
    InputError
        If too few do.
    """
    every = height, np.zeros_like(height) if error is None else error
    lines, doubts = every if along == "x" else (each.T for each in every)
    measured = (
        _measure(*each, pixel, edges, smooth_px) for each in zip(lines, doubts, strict=True)
    )
    profiles = [profile for profile in measured if profile]
    if len(profiles) < MIN_PROFILES:
        shape = "a groove or ridge" if edges == 2 else "a step"
        raise InputError(
            f"{len(profiles)} of {len(lines)} profiles along {along} show {shape}: "
            "crop to the part that holds one, give `along`=x or y, whichever crosses it, and "
            "`edges`=1 or 2"
        )
    return profiles


def depths_with(
    parts: ErrorParts, height: Height, pixel: float, along: str, edges: int
) -> list[float]:
    """The mean depth by a height on cells, and by it with each part of its error."""
    small = cv2.resize(height, parts.shape[:0:-1], interpolation=cv2.INTER_AREA)
    heights = small, *(small + each for each in parts)
    profiles = (step_profiles(z, pixel, None, along, edges, 1) for z in heights)
    return [float(np.mean([profile.depth for profile in each])) for each in profiles]


def parts_within(parts: ErrorParts, crop: Crop | None, shape: tuple[int, ...]) -> ErrorParts:
    """The cells of a part of a height of that shape."""
    x0, y0, x1, y1 = crop or (0, 0, *shape[::-1])
    down, across = np.divide(parts.shape[1:], shape)
    rows = slice(int(y0 * down), int(np.ceil(y1 * down)))
    columns = slice(int(x0 * across), int(np.ceil(x1 * across)))
    return np.asarray(parts[:, rows, columns], np.float32)


def _edge_loss(profiles: list[Profile], pixel: float) -> float:
    """Standard deviation in mm of what edges that lie within a pixel may take off a depth.

    The mean light of level film and of a wall of angle t, half a pixel each, is that of film at
    t / 2, which rises by tan(t / 2) in place of tan(t) / 2.  A wall has two such edges.  How sharp
    they are is not known, so the loss lies evenly between 0 and that.
    """
    wall = np.radians([profile.walls for profile in profiles])
    return pixel * float(np.median(np.tan(wall) - 2 * np.tan(wall / 2))) / np.sqrt(3)


def _warn_of_wide_walls(figures: dict[str, float]) -> None:
    """Warn where a wall reaches into the parts that stand for the levels."""
    least = np.radians(min(figures[name] for name in figures if name.startswith("wall_")))
    run = abs(figures["step_depth_um"]) / 1e3 / np.tan(max(least, 1e-6))
    if run > MAX_WALL_SHARE * figures.get("step_width_mm", np.inf):
        warn(
            "the groove is too narrow for its walls: ISO 5436-1 compares levels that they reach "
            "into, and finds too small a depth"
        )


def _measure(line: Line, error: Line, pixel: float, edges: int, smooth_px: int) -> Profile | None:
    """Measure one profile, its levels of such an error; None where it shows no such edges."""
    x = np.flatnonzero(np.isfinite(line)).astype(float)
    if len(x) < 3 * MIN_ZONE_PX:
        return None
    z = line[x.astype(int)].astype(float)
    places = _edges(x, uniform_filter1d(z, smooth_px, mode="nearest"), edges)
    if places is None:
        return None
    upper, lower = _zones(x, places, _wall_px(x, z))
    if min(upper.sum(), lower.sum()) < MIN_ZONE_PX:
        return None
    used = upper | lower
    side = np.where(upper, 1.0, -1.0)[used]
    terms = np.stack([x[used], np.ones(used.sum()), side], 1)
    slope, level, half = np.linalg.lstsq(terms, z[used], rcond=None)[0]
    levelled = z - slope * x - level
    share = levelled / half if half else np.zeros_like(z)
    walls = tuple(_wall_deg(x, share, place, 2 * abs(half) / pixel) for place in places)
    deviation = error[x.astype(int)]
    of_levels = np.hypot(*(np.nanmean(deviation[level]) for level in (upper, lower)))
    return Profile(2 * half, float(of_levels), places, walls, x, levelled, upper, lower)


def _edges(x: Line, z: Line, count: int) -> tuple[float, ...] | None:
    """Places where the profile crosses the middle between its two levels, `count` of them."""
    if count == 2:
        ends = max(1, int(END_SHARE * len(x)))
        rise = np.median(z[-ends:]) - np.median(z[:ends])
        z = z - x * (rise / (x[-ends:].mean() - x[:ends].mean()))
    for _ in range(2):  # the second time without the tilt
        middle = (np.percentile(z, 5) + np.percentile(z, 95)) / 2
        above = z > middle
        crossings = np.flatnonzero(above[1:] != above[:-1])
        if len(crossings) != count:
            return None
        if count == 2 and above[0] == above[-1]:
            upper = above == above[0]
            z = z - np.polyval(np.polyfit(x[upper], z[upper], 1), x)
    share = (middle - z[crossings]) / (z[crossings + 1] - z[crossings])
    return tuple(x[crossings] + share * (x[crossings + 1] - x[crossings]))


def _wall_px(x: Line, z: Line) -> float:
    """The width of the wall of a step: its height over its steepest slope."""
    steepest = np.abs(np.gradient(z, x)).max()
    return float((z.max() - z.min()) / max(steepest, 1e-12))


def _zones(
    x: Line, places: tuple[float, ...], wall: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """The parts of the profile that show either level; the first begins outside."""
    if len(places) == 1:
        before, after = places[0] - x, x - places[0]
        return (before > wall) & (before < 3 * wall), (after > wall) & (after < 3 * wall)
    left, right = places
    width, beyond = right - left, np.maximum(left - x, x - right)
    middle = np.abs(x - (left + right) / 2) < width / 6
    return (beyond > width / 3) & (beyond < width), middle


def _wall_deg(x: Line, share: Line, place: float, depth_px: float) -> float:
    """The angle of a wall: of the line through its middle part, or of its steepest pixels."""
    low, high = (2 * s - 1 for s in WALL_SHARES)
    near = np.abs(x - place) < np.abs(x - place)[np.abs(share) > high].min(initial=np.inf) + 1
    wall = near & (share > low) & (share < high)
    few = wall.sum() < MIN_ZONE_PX
    near_edge = np.abs(x - place) < MIN_ZONE_PX
    steps = np.diff(share[near_edge]) if few else np.polyfit(x[wall], share[wall], 1)[:1]
    return float(np.degrees(np.arctan(np.abs(steps).max() / 2 * depth_px)))
