"""Fit distortion and tilt of a camera to a square grid."""

from itertools import product
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray
from scipy.optimize import least_squares

from tactograph.rings.camera.nodes.find_grid import GridMarks
from tactograph.rings.camera.nodes.read_grey import GreyImage
from tactograph.sdk import F4, FilmEvidence, InputError, Lens, PixelSize, Port, View, node, warn

POSE_TERMS = 4
"""Parameters of the grid's pose: scale, rotation, and position of the cell 0, 0."""
RADIAL_TERMS = ((), ("k1",), ("k1", "cx", "cy"), ("k1", "k2"), ("k1", "k2", "cx", "cy"))
TILT_TERMS = ("a", "b", "gx", "gy")
MAX_DEVIATIONS = 5.0
"""Robust standard deviations above which a mark is left out."""
MARK_ACCURACY_PX = 0.03
"""Accuracy of a mark's position in px, however well marks fit.  A lens that explains less is not
fitted, so that images stay unchanged."""
MAX_RESIDUAL_PITCHES = 0.05
"""Largest residual of a square grid, relative to its pitch."""
MAX_BEND_PERCENT = 15.0
"""Distortion at the corner above which residuals come from the lens rather than the grid."""
MIN_REACH_SHARE = 0.75
"""Reach of the marks, relative to the half diagonal, below which distortion is extrapolated."""

Places = NDArray[Any]


class LensFit(NamedTuple):
    """A lens, how well it fits, and each mark's departure from it (NaN: left out)."""

    lens: Lens
    pixel: PixelSize
    residual: Annotated[float, Port(unit="px")]
    departure: Annotated[F4, Port("N 2", "px", nan=True)]
    quality: dict[str, float]


@node
def fit_lens(
    image: GreyImage,
    marks: GridMarks,
    *,
    pitch_mm: Annotated[float, Gt(0)],
    camera_mm: Annotated[float, Ge(1 / FilmEvidence.prior("camera").high)] | None = None,
) -> LensFit:
    """Fit scale, tilt and radial distortion (L1 and L2 of `lens`) to the marks of a grid.

    The candidates are lenses with and without tilt, and with no distortion or with k1, its
    centre and k2.  The one with the lowest Bayesian information criterion is taken, so that a
    parameter is only fitted where the marks support it.

    Parameters
    ----------
    image : H x W; only its size is used
    marks : as `find_grid` found them
    pitch_mm : distance between neighbouring marks
    camera_mm : distance of the camera's pupil from the film, which converts the tilt into degrees

    Returns
    -------
    The lens, the pixel size in mm per px at the image's middle, the root mean square distance of
    the marks from the fit in px, the departures N x 2 in px, and figures.

    Raises
    ------
    InputError
        If the marks do not lie on a square grid, or the lens would fold the image.
    """
    shape = (image.shape[0], image.shape[1])
    half = View.unit(shape)
    middle = np.array([shape[1] - 1, shape[0] - 1]) / 2
    places = (marks.place.astype(np.float64) - middle) / half
    inliers = _fitting(places, marks.cell)
    pose, lens = _simplest(places[inliers], marks.cell[inliers], MARK_ACCURACY_PX / half)
    departure = half * (places - _predicted(pose, lens, marks.cell))
    departure[~inliers] = np.nan
    residual = float(np.sqrt(np.nanmean(np.sum(departure**2, axis=1))))
    pitch = half * float(np.exp(pose[0]))
    bend = 100 * float(lens[0] + lens[1])
    reach = float(np.linalg.norm(places[inliers], axis=1).max())
    bend_percent = 100 * abs(float(lens[0] * reach**2 + lens[1] * reach**4))
    crop = _crop_advice(
        middle, half * reach * min(1, (MAX_BEND_PERCENT / max(bend_percent, 1)) ** 0.5)
    )
    problem = f"the {marks.pattern} of the image depart by {residual:.2f} px from any even grid"
    by_lens = (
        f"{problem} through a lens that bends lines by {bend:.0f} % at the corner, more than k1 "
        f"and k2 describe; {crop}"
    )
    if residual > MAX_RESIDUAL_PITCHES * pitch:
        if abs(bend) > MAX_BEND_PERCENT:
            raise InputError(by_lens)
        raise InputError(f"{problem}; lay it flat on the film, or name another `marks.pattern`")
    if _is_folded(lens):
        raise InputError(
            f"the fitted distortion ({bend:.1f} % at the corner) folds the image beyond the marks, "
            f"which reach {reach:.0%} of the way to the corners; show a grid that fills the image, "
            f"or, where the view is round, {crop}"
        )
    if abs(bend) > MAX_BEND_PERCENT and residual > MAX_DEVIATIONS * MARK_ACCURACY_PX:
        warn(by_lens)
    elif reach < MIN_REACH_SHARE:
        warn(
            f"the marks reach {reach:.0%} of the way to the corners; the distortion beyond is "
            "only continued: show a grid that fills the image"
        )
    pixel = pitch_mm / pitch
    width, length = View(lens).pixel_sides(pixel)
    quality: dict[str, float] = {
        "marks": int(inliers.sum()),
        "unused_marks": int((~inliers).sum()) + marks.astray,
        "residual_px": residual,
        "pixel_size_mm": pixel,
        "distortion_corner_percent": bend,
        "oblong_percent": 100 * (width / length - 1),
        "tilt_percent": 100 * float(np.hypot(lens[6], lens[7])),
    }
    if camera_mm is not None:
        sine = np.hypot(lens[6], lens[7]) * camera_mm / (half * pixel)
        quality["tilt_deg"] = float(np.degrees(np.arcsin(min(sine, 1.0))))
    return LensFit(lens.astype(np.float32), pixel, residual, departure.astype(np.float32), quality)


def _fitting(places: Places, cell: Places) -> NDArray[np.bool_]:
    """Flags of the marks that the most flexible lens fits."""
    inliers = np.ones(len(places), bool)
    for _ in range(2):
        pose, lens, _ = _fit(places[inliers], cell[inliers], (*RADIAL_TERMS[-1], *TILT_TERMS))
        away = np.linalg.norm(places - _predicted(pose, lens, cell), axis=1)
        # The median distance of a Gaussian's points in the plane is 1.18 standard deviations.
        inliers = away <= MAX_DEVIATIONS * max(float(np.median(away[inliers])) / 1.18, 1e-6)
    return inliers


def _simplest(places: Places, cell: Places, exact: float) -> tuple[Places, Places]:
    """Pose and lens with the lowest information criterion, n ln(S / n + exact^2) + p ln(n)."""
    best, least = None, np.inf
    for tilt, radial in product(((), TILT_TERMS), RADIAL_TERMS):
        pose, lens, squares = _fit(places, cell, (*radial, *tilt))
        number = POSE_TERMS + len(radial) + len(tilt)
        criterion = places.size * np.log(squares / places.size + exact**2) + number * np.log(
            places.size
        )
        if criterion < least:
            best, least = (pose, lens), criterion
    assert best is not None
    return best


def _fit(places: Places, cell: Places, free: tuple[str, ...]) -> tuple[Places, Places, float]:
    """Fit the pose and the lens's terms named in `free`; return pose, lens and sum of squares."""
    start = np.concatenate([_pose(places, cell), np.zeros(len(free))])

    def lens_of(values: Places) -> Places:
        return View.lens_of(dict(zip(free, values[POSE_TERMS:], strict=True)))

    def wrong(values: Places) -> Places:
        return (_predicted(values[:POSE_TERMS], lens_of(values), cell) - places).ravel()

    low = np.concatenate([np.full(POSE_TERMS, -np.inf), np.full(len(free), -0.5)])
    solution = least_squares(wrong, start, bounds=(low, np.abs(low)), x_scale="jac")
    return solution.x[:POSE_TERMS], lens_of(solution.x), 2 * solution.cost


def _pose(places: Places, cell: Places) -> Places:
    """Logarithm of the pitch, rotation, x and y: the similarity a c + b in complex numbers."""
    z, c = places @ [1, 1j], cell @ [1, 1j]
    a, b = np.linalg.lstsq(np.stack([c, np.ones_like(c)], axis=1), z, rcond=None)[0]
    return np.array([np.log(abs(a)), np.angle(a), b.real, b.imag])


def _predicted(pose: Places, lens: Places, cell: Places) -> Places:
    """The places in the image of the cells of a grid with this pose."""
    size, turn, x, y = pose
    place = np.exp(size + 1j * turn) * (cell @ [1, 1j]) + complex(x, y)
    u, v = place.real, place.imag
    du, dv = View(lens).offset(u, v)
    return np.stack([u + du, v + dv], axis=1)


def _crop_advice(middle: Places, reach_px: float) -> str:
    """Which square about the image's middle has its corners so far from there."""
    side = reach_px / 2**0.5
    x0, y0 = np.ceil(np.maximum(middle - side, 0)).astype(int)
    x1, y1 = np.floor(np.minimum(middle + side, 2 * middle)).astype(int) + 1
    return f"give crop={x0},{y0},{x1},{y1} for this and all other images, or take a longer lens"


def _is_folded(lens: Places) -> bool:
    """Whether a lens maps two ideal positions to one."""
    square = np.linspace(0, 1.2, 50) ** 2
    return bool((1 + 3 * lens[0] * square + 5 * lens[1] * square**2 <= 0).any())
