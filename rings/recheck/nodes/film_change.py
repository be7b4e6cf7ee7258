"""Find what has changed between two frames of the untouched film.

Long because LEDs, ambient light, shift, dirt and dents can only be separated together.
"""

from typing import Annotated, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.rings.recheck.nodes import TiltResponse
from tactograph.rings.recheck.nodes._led_order import other_order
from tactograph.sdk import (
    F4,
    F8,
    Height,
    InputError,
    Light,
    PixelSize,
    Port,
    SizeLimit,
    image_places,
    node,
    robust_deviation,
)
from tactograph.sdk.nodes import flat_field, integrate_dct

MIN_FLAT_LIGHT = np.float32(flat_field.parameters["floor"].default)
"""Light of the film at rest below which it is not used as a divisor."""
MIN_LIGHT = 0.002
"""Smallest light that is not dark: half a step of 8 bits."""
MAX_FIT_WIDTH_PX = 160
"""Most pixels along the image's width to which the smooth part is fitted."""
REWEIGHTING_ROUNDS, CAUCHY_DEVIATIONS = 12, 2.0
"""Rounds of reweighting, and its scale in standard deviations: dents and dirt count little."""
AMBIENT_RIDGE = 1e-4
"""Ridge that holds ambient light and shift near 0, because uniform light does not show them."""
MIN_REMAINING_LIGHT = 0.5
"""Share of its light that a pixel must have under a lower black level, to count."""
MAX_SHIFT_WIDTHS = 0.1
"""Largest plausible shift of the image, as a share of its width."""
MIN_RESPONSE = 0.3
"""Response of the phase correlation above which its peak is a shift, not chance."""
SMOOTHING_PX = 1.0
"""Standard deviation of the Gaussian over which the maps are averaged."""
MAX_PIXELS = 400_000
"""Most pixels of an image that is compared; larger images are binned first."""


class FilmChange(NamedTuple):
    """The film now compared with the film then: global changes and two maps."""

    strength: Annotated[F4, Port("K", "1")]
    """Light of each LED, relative to before."""
    ambient: Annotated[float, Port(unit="1")]
    """Light that comes from no LED, as a fraction of full scale."""
    shift: Annotated[F4, Port("2", "px")]
    """Shift of the image, x and y."""
    albedo: Annotated[F4, Port("H W", "1")]
    """Relative change of light common to all LEDs, without its smooth part."""
    dent: Height
    """The film's height now, minus its height then."""

    def light_percent(self) -> dict[str, float]:
        """Figures ``light_percent/ledN``."""
        return {f"light_percent/led{k}": 100 * float(s) for k, s in enumerate(self.strength, 1)}


@node(sizes={"K": SizeLimit(3, 8, "two LEDs leave the film's tilt open")})
def film_change(
    then: Light, now: Light, tilt: TiltResponse, pixel: PixelSize, *, new_film: bool = False
) -> FilmChange:
    """Distinguish a weaker LED, ambient light, a moved camera, dirt and dents.

    To first order, with I the light then, the light now is::

        I_k s_k (1 + a - d . grad log I_k + p t_kp + q t_kq) + A

    s_k is the LED's strength, A ambient light, which matters most where I_k is dark, and d a
    shift of the image, which shows where I_k is uneven.  Robust least squares fits these to the
    whole image, together with a smooth a of degree 2 in x and y.  The remainder is split pixel
    by pixel into a change of albedo a, which is the same under all LEDs, and a slope (p, q),
    which is not.

    Parameters
    ----------
    then, now : K x H x W, the untouched film, dark level subtracted, equally smooth
    tilt : K x 2 x H x W, t in the equation above
    pixel : mm per px
    new_film
        Whether the film was replaced.  Then smooth changes may differ from LED to LED, and
        ambient light and shift, which cannot be separated from them, are returned as 0.

    Returns
    -------
    Strengths K; ambient light; shift (x, y) in px; albedo H x W; dent H x W in mm, positive where
    the film has risen, median 0.

    Raises
    ------
    InputError
        If the images come in another order than the LEDs did then.
    """
    _check_order(then, now, pixel)
    rows, columns = then.shape[1:]
    factor = int(np.sqrt(rows * columns / MAX_PIXELS)) + 1
    if factor > 1:
        then, now = _reduced(then, factor), _reduced(now, factor)
        tilt = np.stack([_reduced(part, factor) for part in tilt])
        pixel *= columns / then.shape[2]
    moved = np.zeros(2) if new_film else _whole_shift(then, now)
    start = _shifted(then, moved.astype(int))
    safe = np.maximum(start, MIN_FLAT_LIGHT).astype(np.float64)
    # Under an LED that lights the film elsewhere, black pixels are cut off.
    lights_film = np.median(now, axis=(1, 2)) > MIN_FLAT_LIGHT
    is_known = _lit_pixels(start, moved) & ~(now[lights_film] < MIN_LIGHT).any(axis=0)
    ratio = now / safe
    strength, smooth, ambient, shift = _smooth_part(ratio, safe, is_known, new_film)
    is_known &= (smooth > MIN_REMAINING_LIGHT * strength[:, None, None]).all(axis=0)
    rough = np.where(is_known, ratio / np.maximum(smooth, 1e-3) - 1, 0)
    rough = np.stack([cv2.GaussianBlur(plane, (0, 0), SMOOTHING_PX) for plane in rough])
    albedo, slope = _local_part(rough, tilt)
    dent = integrate_dct(slope.astype(np.float32), pixel)
    if factor > 1:
        size = (columns, rows)
        albedo, dent = (np.asarray(cv2.resize(p, size), p.dtype) for p in (albedo, dent))
    return FilmChange(
        strength.astype(np.float32),
        float(ambient),
        (factor * (moved + shift)).astype(np.float32),
        (albedo - np.median(albedo)).astype(np.float32),
        np.asarray(dent - np.median(dent), np.float32),
    )


def _check_order(then: F4, now: F4, pixel: float) -> None:
    """Refuse images of other LEDs: their differences are no changes of the film."""
    order = other_order(then, now, pixel)
    if order is None:
        return
    moved = [f"image {k} has the light of LED {led}" for k, led in enumerate(order, 1) if k != led]
    raise InputError(
        f"the untouched film's images are in another order than the calibration's: "
        f"{', '.join(moved)}; check the cables, the file names (of a colour image the order of "
        "its channels), and that the camera is not turned"
    )


def _reduced(image: F4, factor: int) -> F4:
    """The image binned by `factor`."""
    size = (image.shape[2] // factor, image.shape[1] // factor)
    return np.stack([cv2.resize(plane, size, interpolation=cv2.INTER_AREA) for plane in image])


def _whole_shift(then: F4, now: F4) -> F8:
    """The shift in whole pixels; 0 unless the film's texture shows it beyond doubt."""
    fine = [np.log(np.maximum(image.mean(axis=0), MIN_FLAT_LIGHT)) for image in (then, now)]
    fine = [(plane - cv2.GaussianBlur(plane, (0, 0), 4)).astype(np.float32) for plane in fine]
    rows, columns = fine[0].shape
    window = cv2.createHanningWindow((columns, rows), cv2.CV_32F)
    (dx, dy), response = cv2.phaseCorrelate(fine[0], fine[1], window)
    if response < MIN_RESPONSE or np.hypot(dx, dy) > MAX_SHIFT_WIDTHS * columns:
        return np.zeros(2)
    return np.round(np.array([dx, dy]))


def _shifted(image: F4, by: NDArray[np.intp]) -> F4:
    """The image moved by whole pixels; its border is replicated."""
    rows, columns = image.shape[1:]
    y = np.clip(np.arange(rows) - by[1], 0, rows - 1)
    x = np.clip(np.arange(columns) - by[0], 0, columns - 1)
    return image[:, y[:, None], x]


def _lit_pixels(flat: F4, moved: F8) -> NDArray[np.bool_]:
    """Flags of pixels that every LED lights, then and now."""
    is_known: NDArray[np.bool_] = np.asarray((flat > MIN_FLAT_LIGHT).all(axis=0))
    dx, dy = moved.astype(int)
    rows, columns = is_known.shape
    is_known[: max(dy, 0)] = is_known[rows + min(dy, 0) :] = False
    is_known[:, : max(dx, 0)] = is_known[:, columns + min(dx, 0) :] = False
    return is_known


def _smooth_part(
    ratio: F8, flat: F8, is_known: NDArray[np.bool_], new_film: bool
) -> tuple[F8, F8, float, F8]:
    """The strengths K, the fitted ratio K x H x W, the ambient light, and the shift."""
    count, rows, columns = ratio.shape
    step = columns // MAX_FIT_WIDTH_PX + 1
    u, v = np.broadcast_arrays(*image_places(flat.shape[1:], 2 / columns))
    place = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v]).astype(np.float64)
    strength = np.median(ratio[:, is_known], axis=1) if is_known.any() else np.ones(count)
    if new_film:  # six smooth terms for each LED
        each = np.eye(count)[:, None, :, None, None] * place[None, :, None]
        basis = each.reshape(-1, count, rows, columns)
    else:
        basis = _basis(place, flat, strength)
    some = np.zeros_like(is_known)
    some[::step, ::step] = is_known[::step, ::step]
    doubted = np.arange(len(basis)) >= len(basis) - (0 if new_film else 3)
    coefficients = _robust(
        basis[:, :, some].reshape(len(basis), -1), ratio[:, some].ravel(), doubted.astype(float)
    )
    fitted = np.tensordot(coefficients, basis, axes=1)
    if new_film:
        levels = fitted[:, is_known].mean(axis=1) if is_known.any() else strength
        return np.asarray(levels), fitted, 0.0, np.zeros(2)
    by_led, (ambient, *shift) = coefficients[:count], coefficients[count + 5 :]
    return by_led * strength, fitted, float(ambient), -np.array(shift)


def _basis(place: F8, flat: F8, strength: F8) -> F8:
    """Columns x K x H x W: a strength for each LED, five smooth terms, ambient light, a shift.

    All but ambient light are scaled by a rough estimate of the LED's strength.
    """
    rough = strength[:, None, None]
    by_led = np.eye(len(flat))[:, :, None, None] * rough * np.ones_like(flat)
    slope_y, slope_x = np.gradient(np.log(flat), axis=(1, 2))
    shared = rough * place[1:, None]
    return np.concatenate(
        [by_led, shared, 1 / flat[None], (rough * slope_x)[None], (rough * slope_y)[None]]
    )


def _robust(basis: F8, ratio: F8, doubted: F8) -> F8:
    """Iteratively reweighted least squares (Cauchy); columns marked `doubted` stay near zero."""
    weight = np.ones_like(ratio)
    coefficients: F8 = np.zeros(len(basis))
    for _ in range(REWEIGHTING_ROUNDS):
        weighted = basis * weight
        normal = weighted @ basis.T
        ridge = 1e-9 * np.trace(normal) / len(basis) + AMBIENT_RIDGE * np.diag(normal) * doubted
        coefficients = np.asarray(
            np.linalg.solve(normal + np.diag(ridge), weighted @ ratio), np.float64
        )
        residual = ratio - coefficients @ basis
        spread = robust_deviation(residual) + 1e-9
        weight = 1 / (1 + (residual / (CAUCHY_DEVIATIONS * spread)) ** 2)
    return np.asarray(coefficients)


def _local_part(rough: F8, tilt: F4) -> tuple[F8, F8]:
    """Least squares over the LEDs of each pixel: albedo H x W and slope 2 x H x W."""
    design = np.concatenate([np.ones_like(rough)[:, None], tilt], axis=1).astype(np.float64)
    normal = np.einsum("kaij,kbij->ijab", design, design)
    right = np.einsum("kaij,kij->ija", design, rough)
    solution = np.linalg.solve(normal + 1e-9 * np.eye(3), right[..., None])[..., 0]
    return solution[..., 0], np.moveaxis(solution[..., 1:], -1, 0)
