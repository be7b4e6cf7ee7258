"""Interreflection of a coated film, which `film_bounce` uses in place of a matt film's.

A matt base radiates in all directions.  A coat lets less light through at grazing angles, on the
way in and on the way out.  It also mirrors light of the LEDs to other places of the film, and light
of other places into the camera.  With T and the mirrored part f_m of equation F2 (`film`), cell j
sends to P, under LED k,

    e_kj = (E_j r_k - E_jk f_m(l, v)) T(to P) / T(v) + E_jk f_m(l, to P)

where E_j r_k is the light that the camera sees of it, and f_m is in units of base / pi.  In place
of L in equation B1, P throws back

    [T(d) T(v) + f_m(d, v)] e_kj / r_k.                                                       (B2)

r_k is the reflectance of the film at rest.  A lobe at a grazing angle is narrower than the angle
between two azimuths, so its mean over that angle is used (`_facets`).  A cell that shows less
light than the LED alone would give it is taken to be shadowed; the light that its coat mirrors is
reduced by the same factor.  Light that is mirrored twice between cells is part of the light that
the camera sees.

``kernels/headers/coated_bounce.clh`` is the same.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, Film
from tactograph.nodes.optics.coat import MIN_COSINE, fresnel, let_in_by, let_in_curve, masking
from tactograph.nodes.optics.film import direct_share, glint, to_pupil
from tactograph.nodes.optics.normals import cross, dot
from tactograph.nodes.optics.radiosity import Cells, Grid
from tactograph.nodes.optics.sweep import Law

MIN_COSINE_F4 = np.float32(MIN_COSINE)
MIN_DIVISOR = np.float32(1e-12)
"""Prevents division by 0."""
MIN_LOBE_EXPONENT = np.float32(-9)
"""Exponent below which a lobe counts as 0."""


class _Surface(NamedTuple):
    """Places of a film, normals and directions to the pupil, 3 x N each; and for those directions
    the cosine to the normal, T, and the factor in f_m, N each."""

    at: F4
    normal: F4
    eye: F4
    to_eye: F4
    let_out: F4
    unhidden: F4


class _Sent(NamedTuple):
    """For each LED: the light of a cell's base, over T; the light that its coat mirrors, with the
    factor of the LED's direction in f_m; the cosine of that direction to the normal, K x N each;
    and the direction, 3 x N."""

    base: F4
    mirrored: F4
    facing: F4
    towards: list[F4]


def coated(film: Film, cells: Cells, sources: F4, grid: Grid) -> Law:
    """The law of light between cells of a coated film that sends `sources` to the camera.

    Light is relative to the film at rest that the same pixel sees.
    """
    frame = slice(None), *grid.frame
    senders = _surface(film, cells.at.reshape(3, -1), cells.normal.reshape(3, -1))
    receivers = _surface(film, cells.at[frame].reshape(3, -1), cells.normal[frame].reshape(3, -1))
    sent = _emitted(film, senders, sources.reshape(len(sources), -1))
    by_rest = np.stack([1 / _at_rest(film, light, receivers.at) for light in film.lights])
    turn = np.float32(math.pi / grid.azimuths)

    def thrown(at: NDArray[np.intp], away: F4, other: NDArray[np.intp]) -> F4:
        eye, normal = receivers.eye[:, at], receivers.normal[:, at]
        facing = senders.normal[:, other]
        # Perpendicular to both directions at P, and at the cells to the direction towards P.
        aside, along = turn * cross(eye, away), dot(eye, away)
        square = turn * turn * (1 - along * along)
        c_in, c_out = dot(normal, away), -dot(facing, away)
        rises = dot(normal, aside)
        half, reach = receivers.to_eye[at] + c_in, square - rises * rises
        back = _facets(film, half, 2 + 2 * along, reach, -half * rises)
        back *= receivers.unhidden[at] * _unhidden(film, c_in)
        back += receivers.let_out[at] * _let_in(film, c_in)
        let_out, unhidden = _let_in(film, c_out), _unhidden(film, c_out) * (c_out > 0)
        rises = dot(facing, aside)
        reach = square - rises * rises
        reflectance = np.empty((len(by_rest), at.size), np.float32)
        for k, led in enumerate(sent.towards):
            light, half = led[:, other], sent.facing[k, other] + c_out
            lobe = _facets(
                film, half, 2 - 2 * dot(light, away), reach, dot(light, aside) - half * rises
            )
            base = sent.base[k, other] * let_out
            reflectance[k] = back * (base + sent.mirrored[k, other] * unhidden * lobe)
        return np.asarray(reflectance * by_rest[:, at], np.float32)

    return thrown


def source_rows(leds: int) -> int:
    """Return the rows of the kernels' table of sources."""
    return 5 * leds


def _surface(film: Film, at: F4, normal: F4) -> _Surface:
    eye = np.stack(to_pupil(film.camera, *at))
    to_eye = dot(normal, eye)
    return _Surface(at, normal, eye, to_eye, _let_in(film, to_eye), _unhidden(film, to_eye))


def _emitted(film: Film, surface: _Surface, sources: F4) -> _Sent:
    base, mirrored, facing = (np.empty_like(sources) for _ in range(3))
    towards = []
    for k, (light, share) in enumerate(zip(film.lights, direct_share(film), strict=True)):
        led = light[:, None] - surface.at
        square = (led * led).sum(0)
        led = led / np.sqrt(square)
        facing[k] = dot(surface.normal, led)
        lit = np.maximum(facing[k], 0)
        whole = share * lit * light[2] * light[2] / square
        light_at_rest = sources[k] * _at_rest(film, light, surface.at)
        lobe = _mirrored(film, facing[k], surface.to_eye, dot(led, surface.eye))
        unshadowed = whole * (_let_in(film, lit) * surface.let_out + lobe)
        whole *= np.minimum(light_at_rest / np.maximum(unshadowed, MIN_DIVISOR), 1)
        base[k] = np.maximum(light_at_rest - whole * lobe, 0) / surface.let_out
        mirrored[k] = whole * _unhidden(film, facing[k])
        towards.append(np.asarray(led, np.float32))
    return _Sent(base, mirrored, facing, towards)


def _at_rest(film: Film, light: F4, at: F4) -> F4:
    """r_k: the reflectance of the film at rest seen at 3 x N places, in units of base / pi."""
    nearer = 1 - np.float32(film.camera) * at[2]
    flat = np.stack([at[0] / nearer, at[1] / nearer, np.zeros_like(nearer)])
    level = np.zeros_like(flat)
    level[2] = 1
    eye = np.stack(to_pupil(film.camera, *flat))
    led = light[:, None] - flat
    led /= np.sqrt((led * led).sum(0))
    base = _let_in(film, led[2]) * _let_in(film, eye[2])
    return np.asarray(base + _mirrored(film, led[2], eye[2], dot(led, eye)), np.float32)


def _let_in(film: Film, cosine: F4) -> F4:
    curve = let_in_curve(film.roughness, film.refraction)
    return let_in_by(curve, np.maximum(cosine, MIN_COSINE_F4))


def _unhidden(film: Film, cosine: F4) -> F4:
    """The factor of f_m that depends on one direction alone."""
    c = np.maximum(cosine, MIN_COSINE_F4)
    return np.asarray(masking(c, film.roughness) / c, np.float32)


def _mirrored(film: Film, c_i: F4, c_o: F4, between: F4) -> F4:
    """f_m in units of base / pi, from the cosines to the light, to the eye, and between the two."""
    size = np.sqrt(np.maximum(2 + 2 * between, MIN_DIVISOR))
    c_h = np.maximum((c_i + c_o) / size, MIN_COSINE_F4)
    lobe = glint(
        film, np.maximum(c_i, MIN_COSINE_F4), np.maximum(c_o, MIN_COSINE_F4), c_h, size / 2
    )
    return np.asarray(np.float32(np.pi / film.base) * lobe, np.float32)


def _facets(film: Film, half: F4, square: F4, reach: F4, sideways: F4) -> F4:
    """The factor of f_m that depends on two directions, in units of base / pi, averaged over one.

    `half` is the component of their sum along the normal, `square` the square of the sum.  The
    mean is over one direction that moves by up to s to either side.  In the plane of the
    microfacets' slopes Beckmann's density is a Gaussian.  Its mean along a line is nearly a
    Gaussian, too, whose square width is larger by 2 / 3 of the square of half the line.  `reach` is
    the square of the component of s perpendicular to the normal, `sideways` its product with that
    of the sum.
    """
    size = np.maximum(square, 0) + MIN_DIVISOR
    forwards = np.maximum(half, MIN_COSINE_F4 * np.sqrt(size))
    width = np.float32(film.roughness**2) * forwards * forwards
    moved = width + np.float32(2 / 3) * reach
    falls = (np.float32(2 / 3) * sideways * sideways / moved - (size - half * half)) / width
    factors, near = np.zeros_like(half), np.nonzero(falls > MIN_LOBE_EXPONENT)
    size = size[near]
    lobe = np.exp(np.minimum(falls[near], 0)) * np.sqrt(width[near] / moved[near])
    cosine = forwards[near] ** 2 / size
    mirrored = fresnel(np.sqrt(size) / 2, film.refraction)
    scale = np.float32(0.25 / (film.base * film.roughness**2))
    factors[near] = scale * lobe / (cosine * cosine) * mirrored
    return factors
