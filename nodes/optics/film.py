"""The light of a real film: the model that calibration, measurement and simulation share.

A matt film under point lights has the light n.v relative to the film at rest (`near_light`,
N1).  A real film departs from it in ways that presses show.  At P = (x, y, z), seen from the
pupil at (0, 0, D), with unit normal n and LED k at L::

    m_k = s(z) (b_k + (1 - b_k) a_k [e_k(n, P) / e_k(z, P_0)]_w)
          + fade(n) sum_b c_kb(x, y) B_b(n)                                             (F1)

b_k is the share of LED light that the gel diffuses, so that shadows are not black.  [.]_w is
`wrapped`: scattered light reaches a little behind the terminator.  a_k is the light at P relative
to P_0 of an LED that emits as cos^m of the angle from its axis (`led_axis`), such as a disk (m =
1): the m-th power of the ratio of the cosines, as a series of second order.  s grows from 1 to
`gain` where an object touches the film and lifts it by `contact` mm.  e is irradiance times the
reflectance of a rough dielectric coat over a matt base (`coat`)::

    e(n, P) = n.l / |L - P|^2 [k_d T(n.l) T(n.v) / pi
                                       + F(v.h) D(n.h) G / (4 n.l n.v)]                     (F2)

with h between the direction l to the light and v to the pupil, T what the coat lets through
(`let_in`); a `refraction` of 1 has F = 0 and is the matt film.  B are the second-order harmonics of
the normal (the paper's equation 4), each minus its value at rest, and c are polynomials of degree
2 in the place.  They fade out where n_z is below that of all presses, so that only the physical
part remains.  P_0 is the film at rest that the same pixel sees.
``kernels/headers/film.clh`` is the same.
"""

from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import Film
from tactograph.nodes.optics.coat import (
    MIN_COSINE,
    beckmann,
    fresnel,
    let_in_by,
    let_in_change,
    let_in_curve,
    masking,
)
from tactograph.nodes.optics.near_light import wrapped

FilmPart = Literal["diffuse", "lobe", "harmonics", "bounce", "aim", "camera"]
"""Parts that equation F1 adds to a matt film; a model may omit each."""
LIGHT_FIELDS = (
    "lights", "diffuse", "wrap", "harmonics", "flattest", "reach", "gain", "contact", "base",
    "roughness", "refraction", "camera", "emission", "aim",
)  # fmt: skip
"""The fields of `Film` on which its light depends."""
HARMONIC_COUNT, PLACE_TERMS = 8, 6
"""Number of harmonics, and of terms 1, u, v, u^2, u v, v^2 of the polynomial in the place."""
HARMONIC_DEGREES = range(3)
"""Degrees of that polynomial."""
FADE_WIDTH = 0.15
"""Width in n_z over which the harmonics fade out beyond the steepest pressed slope."""

MAX_TURN_RAD = 0.3
"""Longest step of a normal, in radians."""
FLATTEST_TRIED = 0.1
"""Smallest n_z of a normal that is tried."""
MIN_MATT_LIGHT, FULL_MATT_LIGHT = 0.05, 0.2
"""Matt light at which an LED begins to count for the normal, and at which it counts fully."""
LIGHT_NOISE_SHARE = 0.01
"""Noise of a pixel's light, as a share of it."""
MIN_DIRECT_SHARE = 0.05
"""Lower bound on 1 - b in a denominator."""

MIN_SHARPNESS = 0.5
"""Smallest ratio of the derivatives of a coated and a matt film's light by the normal; beyond
grazing angles it is unknown."""

Array = NDArray[Any]
Place = tuple[Array, Array, Array]


def term_count(degree: int) -> int:
    """Return the number of terms of a polynomial in the place, of this degree."""
    return (degree + 1) * (degree + 2) // 2


def is_affine(film: Film) -> bool:
    """Return whether light, up to the terminator, is a linear function of the normal."""
    return film.refraction == 1 and film.camera == 0 and not film.harmonics.any()


def predict(
    film: Film,
    n: Array,
    x: Array,
    y: Array,
    z: Array,
    rest: Array | None = None,
    lift: Array | None = None,
) -> Array:
    """Return the light relative to the film at rest, equation F1, without bounced light: K x N.

    Parameters
    ----------
    film : the LEDs' and the film's properties
    n : 3 x N, unit normals
    x, y, z : of length N in mm, where the film is
    rest : K x N, from `rest_below`, where it is known
    lift : N in mm, the height above the film at rest; None: `z`, for a plane at rest
    """
    if rest is None:
        rest = rest_below(film, x, y, z)
    touched = touch_gain(film, z if lift is None else lift)
    planes = np.empty((len(film.lights), *np.shape(x)), np.result_type(x, n))
    for k, direct in enumerate(_reflected(film, n, x, y, z)):
        b = film.diffuse[k]
        shine = emitted(film, k, (x, y, z))
        planes[k] = touched * (b + (1 - b) * shine * wrapped(direct / rest[k], film.wrap))
    if film.harmonics.any():
        shade = shades(n) * _fade(film, n)
        for k, strength in enumerate(_strengths(film, x, y, z)):
            planes[k] += (strength * shade).sum(0)
    return planes


def _strengths(film: Film, x: Array, y: Array, z: Array) -> Iterator[Array]:
    """Yield the coefficients of the harmonics of equation F1 at a place, 8 x N, LED by LED."""
    x0, y0 = _below(film, x, y, z)
    place = place_terms(x0 / film.reach, y0 / film.reach)
    for terms in film.harmonics:
        yield terms @ place


def _fade(film: Film, n: Array) -> Array:
    """Return the fade of equation F1."""
    return np.asarray(np.clip(1 + (n[2] - film.flattest) / FADE_WIDTH, 0, 1))


def _below(film: Film, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
    """Return the places of the film at rest that the same pixels see."""
    nearer = 1 - film.camera * z
    return x / nearer, y / nearer


def place_seen(film: Film, u: Array, v: Array, apparent: Array) -> Place:
    """Return x, y, z of the film that the camera sees at places of the film at rest and heights."""
    by = np.float32(film.camera)
    z = np.asarray(apparent / (1 + by * apparent))
    return u * (1 - by * z), v * (1 - by * z), z


def touch_gain(film: Film, z: Array) -> Array:
    """Return s of equation F1."""
    return np.asarray(1 + np.float32(film.gain - 1) * np.clip(z / np.float32(film.contact), 0, 1))


def led_axis(film: Film, led: int) -> Array:
    """Return where an LED turns its back: away from the film's middle, or by `aim` more upwards."""
    light = film.lights[led]
    return np.asarray(light * np.array([1 - film.aim, 1 - film.aim, 1], light.dtype))


def emitted(film: Film, led: int, place: Place) -> Array:
    """Return a of equation F1 for one LED."""
    if not film.emission:
        return np.ones((), np.asarray(place[2]).dtype)
    x, y, z = place
    x0, y0 = _below(film, x, y, z)
    ax, ay, az = axis = led_axis(film, led)
    light, m = film.lights[led], film.emission
    far = (axis * light).sum()
    *_, square, _ = _way(light, x, y, z)
    *_, square0, _ = _way(light, x0, y0, np.zeros_like(z))
    cosines = (far - ax * x - ay * y - az * z) / (far - ax * x0 - ay * y0)
    more = cosines * np.sqrt(square0 / square) - 1
    return np.asarray(1 + m * more * (1 + (m - 1) / 2 * more))


def direct_share(film: Film) -> Array:
    """Return 1 - b by LED."""
    return np.maximum(1 - film.diffuse, MIN_DIRECT_SHARE)


def lit_share(film: Film, light: Array, z: Array) -> Array:
    """Return the weight of light for a normal, 0 to 1, K x N; 0 where it has no direct light."""
    diffuse, direct = film.diffuse[:, None], direct_share(film)[:, None]
    share = (light / touch_gain(film, z) - diffuse) / direct
    return np.clip((share - MIN_MATT_LIGHT) / (FULL_MATT_LIGHT - MIN_MATT_LIGHT), 0, 1)


def turned(
    film: Film,
    light: Array,
    n: Array,
    place: Place,
    uneven: float = 0.0,
    rest: Array | None = None,
    lift: Array | None = None,
    *,
    penumbras: bool = False,
) -> Array:
    """Return normals that explain the light better, by one Gauss-Newton step.

    The step is in the tangent plane, n + s (n_z, 0, -n_x) + t (0, n_z, -n_y).  LEDs whose direct
    light does not reach the film do not count.

    Parameters
    ----------
    film : the LEDs' and the film's properties
    light : K x N, relative to the film at rest, without bounced light
    n : 3 x N, unit normals
    place : x, y, z in mm
    uneven
        Standard deviation of the film's brightness, as a share; the light of each LED has the
        standard deviation `LIGHT_NOISE_SHARE`.
    rest, lift : as for `predict`
    penumbras
        Whether a shadow may leave an LED a part of its light: it then counts by the fourth power of
        its direct light over that predicted for n, at most 1.
    """
    if rest is None:
        rest = rest_below(film, *place)
    lift = place[2] if lift is None else lift
    before = predict(film, n, *place, rest, lift)
    by_s, by_t = _changes(film, n, place, rest, lift)
    weight = lit_share(film, light, lift) / np.maximum(light, FULL_MATT_LIGHT) ** 2
    if penumbras:
        diffused = touch_gain(film, lift) * film.diffuse[:, None]
        direct = np.maximum(before - diffused, MIN_MATT_LIGHT)
        weight = weight * np.clip((light - diffused) / direct, 0, 1) ** 4
    share = uneven**2 / (LIGHT_NOISE_SHARE**2 + uneven**2 * (weight * before * before).sum(0))
    along = [(weight * before * f).sum(0) for f in (by_s, by_t, light - before)]

    def sum_of(f: Array, g: Array, i: int, j: int) -> Array:
        return np.asarray((weight * f * g).sum(0) - share * along[i] * along[j])

    a, b, c = sum_of(by_s, by_s, 0, 0), sum_of(by_s, by_t, 0, 1), sum_of(by_t, by_t, 1, 1)
    g, h = sum_of(by_s, light - before, 0, 2), sum_of(by_t, light - before, 1, 2)
    # The normal stays along a direction that a single LED, or two in line, leave undetermined.
    ridge = 1e-3 * (a + c) + 1e-6
    a, c = a + ridge, c + ridge
    inverse = 1 / (a * c - b * b)
    s, t = (c * g - b * h) * inverse, (a * h - b * g) * inverse
    shrink = MAX_TURN_RAD / np.maximum(np.sqrt(s * s + t * t), MAX_TURN_RAD)
    s, t = s * shrink, t * shrink
    nx, ny, nz = n
    new = np.stack([nx + s * nz, ny + t * nz, nz - s * nx - t * ny])
    np.maximum(new[2], FLATTEST_TRIED, out=new[2])
    return np.asarray(new / np.sqrt((new * new).sum(0)))


def _changes(film: Film, n: Array, place: Place, rest: Array, lift: Array) -> tuple[Array, Array]:
    """Return the derivatives of equation F1 by s and t of `turned`, K x N each.

    Direct light of an LED behind the film is differentiated as if it continued below zero.
    """
    nx, ny, nz = n
    none = np.zeros_like(nx)
    tangents = np.stack([nz, none, -nx]), np.stack([none, nz, -ny])
    by_normal = list(_reflected(film, n, *place, turning=True))
    differences = [np.stack([(along * by).sum(0) for by in by_normal]) for along in tangents]
    shine = np.stack([emitted(film, k, place) + 0 * plane for k, plane in enumerate(rest)])
    scale = touch_gain(film, lift) * (1 - film.diffuse[:, None]) * shine / rest
    s, t = (scale * change for change in differences)
    if film.harmonics.any():
        by_s, by_t = (_shades_change(film, n, along) for along in tangents)
        for k, strength in enumerate(_strengths(film, *place)):
            s[k] += (strength * by_s).sum(0)
            t[k] += (strength * by_t).sum(0)
    return s, t


def coat_sharpness(film: Film, n: Array, place: Place, weight: Array) -> Array:
    """Return how much faster a coated film's light changes with its normal than a matt film's.

    It is the root of the ratio of the squared derivatives along two tangents, summed over the LEDs.

    Parameters
    ----------
    film : the LEDs' and the film's properties
    n : 3 x N, unit normals
    place : x, y, z in mm
    weight : K x N, of the LEDs; the result is 1 if all are zero
    """
    dark, plain = np.zeros_like(film.diffuse), np.zeros_like(film.harmonics)
    coat = film._replace(gain=1.0, emission=0.0, diffuse=dark, harmonics=plain)
    squares = []
    for kind in (coat, coat._replace(refraction=1.0)):
        by_s, by_t = _changes(kind, n, place, rest_below(kind, *place), place[2])
        squares.append((weight * (by_s * by_s + by_t * by_t)).sum(0))
    coated, matt = squares
    sharper = np.sqrt(np.where(matt > 0, coated / np.where(matt > 0, matt, 1), 1))
    return np.asarray(np.maximum(sharper, MIN_SHARPNESS))


def _shades_change(film: Film, n: Array, along: Array) -> Array:
    """Return the derivative of the harmonics, faded, by a normal along a tangent: 8 x N."""
    (x, y, z), (dx, dy, dz) = n, along
    by = [dx, dy, dz, dx * y + x * dy, dx * z + x * dz, dy * z + y * dz]
    change = np.stack([*by, 2 * (x * dx - y * dy), 6 * z * dz])
    fade = _fade(film, n)
    fading = np.where((fade > 0) & (fade < 1), dz / FADE_WIDTH, 0)
    return np.asarray(fade * change + fading * shades(n))


def rest_light(film: Film, x: Array, y: Array) -> Array:
    """Return the light of the film at rest, K x N, up to a factor for each LED."""
    light_at_rest = at_rest(film, x, y)
    scale = [np.linalg.norm(light) ** 2 for light in film.lights]
    return np.stack([by * plane for by, plane in zip(scale, light_at_rest, strict=True)])


def rest_below(film: Film, x: Array, y: Array, z: Array) -> Array:
    """Return `at_rest`, K x N, of the film at rest that the pixels of these places see."""
    return at_rest(film, *_below(film, x, y, z))


def at_rest(film: Film, x: Array, y: Array) -> Array:
    """Return e of the film at rest (equation F2), K x N, up to a factor."""
    level = np.zeros((3, *np.shape(x)), np.asarray(x).dtype)
    level[2] = 1
    return np.stack(list(_reflected(film, level, x, y, np.zeros_like(x))))


def shades(n: Array) -> Array:
    """Return the second-order harmonics of normals 3 x N, minus their values at rest: 8 x N."""
    x, y, z = n
    return np.stack([x, y, z - 1, x * y, x * z, y * z, x * x - y * y, 3 * (z * z - 1)])


def place_terms(u: Array, v: Array) -> Array:
    """Return 1, u, v, u^2, u v, v^2: 6 x N."""
    return np.stack([np.ones_like(u), u, v, u * u, u * v, v * v])


def _reflected(
    film: Film, n: Array, x: Array, y: Array, z: Array, turning: bool = False
) -> Iterator[Array]:
    """Yield equation F2, up to a factor, LED by LED; or its derivative by the normal, 3 x N.

    The derivative neglects that of masking.
    """
    coated = film.refraction != 1
    if coated:
        curve = let_in_curve(film.roughness, film.refraction)
        v = np.stack(to_pupil(film.camera, x, y, z))
        c_o = np.maximum((n * v).sum(0), MIN_COSINE)
        let_out, by_base = let_in_by(curve, c_o), film.base / np.pi
    for light in film.lights:
        *to, square, away = _way(light, x, y, z)
        way = np.stack(to) / away
        facing = (n * way).sum(0)
        if not coated:
            yield np.asarray((way if turning else facing) / square)
            continue
        h = way + v
        h /= np.sqrt((h * h).sum(0))
        c_i, c_h = (np.maximum(c, MIN_COSINE) for c in (facing, (n * h).sum(0)))
        let_in, mirrored = let_in_by(curve, c_i), glint(film, c_i, c_o, c_h, (v * h).sum(0))
        base = by_base * let_in * let_out
        if not turning:
            yield np.asarray(facing / square * (base + mirrored))
            continue
        more = by_base * let_out * c_i * let_in_change(curve, c_i)
        by_light = base + np.where(c_i > MIN_COSINE, more, mirrored)
        by_half = facing * mirrored * (2 / (film.roughness * c_h) ** 2 - 4) / c_h
        by_eye = facing * (by_base * let_in * let_in_change(curve, c_o) - mirrored / c_o)
        by_eye = np.where(c_o > MIN_COSINE, by_eye, 0)
        yield np.asarray((by_light * way + by_half * h + by_eye * v) / square)


def _way(light: Array, x: Array, y: Array, z: Array) -> tuple[Array, ...]:
    """Return the vector to an LED, its length squared, and its length."""
    dx, dy, dz = light[0] - x, light[1] - y, light[2] - z
    square = dx * dx + dy * dy + dz * dz
    return dx, dy, dz, square, np.sqrt(square)


def to_pupil(camera: float, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
    """Return the unit vector from the film to the pupil, at 1 / `camera` mm above the film."""
    vx, vy, vz = -camera * x, -camera * y, 1 - camera * z
    scale = 1 / np.sqrt(vx * vx + vy * vy + vz * vz)
    return vx * scale, vy * scale, vz * scale


def glint(film: Film, c_i: Array, c_o: Array, c_h: Array, v_h: Array) -> Array:
    """Return the light that the coat's microfacets mirror: the second part of equation F2.

    The cosines are those of the normal to the light, to the eye and to the direction h between
    them, and that of the eye to h.
    """
    spread = beckmann(c_h, film.roughness) * fresnel(v_h, film.refraction)
    hidden = masking(c_i, film.roughness) * masking(c_o, film.roughness)
    return np.asarray(spread * hidden / (4 * c_i * c_o))
