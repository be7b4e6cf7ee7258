"""What a coated film throws on itself: in `film_bounce` it takes the place of a matt film.

A matt base lights all around; under a coat it does so less at grazing angles, on the way in and on
the way out.  The coat mirrors, too: light of the LEDs on to other places of the film, and light
of other places into the camera.  With T and the mirrored part f_m of equation F2 (`_film`), cell j
sends to P, under LED k,

    e_kj = (E_j r_k - E_jk f_m(l, v)) T(to P) / T(v) + E_jk f_m(l, to P)

where E_j r_k is what the camera sees of it, f_m in parts of base / pi, and for L of equation B1
P throws back

    [T(d) T(v) + f_m(d, v)] e_kj / r_k.

r_k is the reflectance of the film at rest.  Of a cell that shows less light than the LED alone
would give it, a shadow takes the rest, and as much of what the coat mirrors.  Light that the coat
mirrors twice between cells before it reaches the camera is in what the camera sees.
``kernels/headers/coated_bounce.clh`` holds the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, Film
from tactograph.nodes.light._coat import fresnel, let_in, masking
from tactograph.nodes.light._film import GRAZING, direct_share, to_pupil
from tactograph.nodes.light._radiosity import Cells, Grid
from tactograph.nodes.light._sweep import COATED_AZIMUTHS, Law

LEAST = np.float32(GRAZING)
NOT_ASIDE = np.zeros((3, 1), np.float32)
NEAREST = np.float32(1e-12)
"""Keeps from dividing by 0."""


class _Surface(NamedTuple):
    """Places of a film, each 3 x N: normals, directions to the pupil; T along those, N."""

    at: F4
    normal: F4
    eye: F4
    to_eye: F4
    let_out: F4


def coated(film: Film, cells: Cells, sources: F4, grid: Grid, from_above: bool = False) -> Law:
    """Cells of a film with a coat, of which the camera sees so much light.

    Light is relative to the film at rest that the same pixel sees, or to that below (`from_above`).
    """
    at_rest = film._replace(camera=0.0) if from_above else film

    def rest(light: F4, at: F4) -> F4:
        nearer = 1 - np.float32(at_rest.camera) * at[2]
        return _at_rest(film, light, at[:2] / nearer)

    frame = slice(None), *grid.frame
    there = _surface(film, cells.at.reshape(3, -1), cells.normal.reshape(3, -1))
    here = _surface(film, cells.at[frame].reshape(3, -1), cells.normal[frame].reshape(3, -1))
    emitted, mirrored = _emitted(film, there, sources.reshape(len(sources), -1), rest)
    by_rest = np.stack([1 / rest(light, here.at) for light in film.lights])
    towards = [light[:, None] - there.at for light in film.lights]
    towards = [led / np.sqrt((led * led).sum(0)) for led in towards]

    def thrown(at: NDArray[np.intp], away: F4, other: NDArray[np.intp]) -> F4:
        normal, eye = here.normal[:, at], here.eye[:, at]
        aside = np.float32(math.pi / COATED_AZIMUTHS) * _cross(eye, away)
        c_in = np.maximum(_dot(normal, away), 0)
        lobe = _mirrored(film, normal, away, eye, aside)
        back = here.let_out[at] * _let_in(film, c_in) + lobe
        facing = there.normal[:, other]
        let_out = _let_in(film, np.maximum(-_dot(facing, away), 0))
        found = np.empty((len(emitted), at.size), np.float32)
        for k, led in enumerate(towards):
            lobe = _mirrored(film, facing, led[:, other], -away, aside)
            found[k] = back * (emitted[k, other] * let_out + mirrored[k, other] * lobe)
        return np.asarray(found * by_rest[:, at], np.float32)

    return Law(COATED_AZIMUTHS, thrown)


def source_rows(leds: int) -> int:
    """Return the rows of the kernels' table of sources: SOURCE_ROWS."""
    return 5 * leds


def _surface(film: Film, at: F4, normal: F4) -> _Surface:
    normal = normal / np.sqrt((normal * normal).sum(0))
    eye = np.stack(to_pupil(film.camera, *at))
    to_eye = np.maximum(_dot(normal, eye), LEAST)
    return _Surface(at, normal, eye, to_eye, _let_in(film, to_eye))


def _emitted(
    film: Film, there: _Surface, sources: F4, rest: Callable[[F4, F4], F4]
) -> tuple[F4, F4]:
    """What the base sends, over T, and the LED's light that the coat mirrors: K x N each."""
    emitted, mirrored = np.empty_like(sources), np.empty_like(sources)
    for k, (light, share) in enumerate(zip(film.lights, direct_share(film), strict=True)):
        led = light[:, None] - there.at
        square = (led * led).sum(0)
        led = led / np.sqrt(square)
        lit = np.maximum(_dot(there.normal, led), 0)
        mirrored[k] = share * lit * light[2] * light[2] / square
        seen = sources[k] * rest(light, there.at)
        lobe = _mirrored(film, there.normal, led, there.eye)
        unshadowed = mirrored[k] * (_let_in(film, lit) * there.let_out + lobe)
        mirrored[k] *= np.minimum(seen / np.maximum(unshadowed, NEAREST), 1)
        emitted[k] = np.maximum(seen - mirrored[k] * lobe, 0) / there.let_out
    return emitted, mirrored


def _at_rest(film: Film, light: F4, at: F4) -> F4:
    """r_k: the reflectance of the film at rest at 2 x N places, in parts of base / pi."""
    flat = np.stack([at[0], at[1], np.zeros_like(at[0])])
    level = np.zeros_like(flat)
    level[2] = 1
    eye = np.stack(to_pupil(film.camera, *flat))
    led = light[:, None] - flat
    led /= np.sqrt((led * led).sum(0))
    base = _let_in(film, led[2]) * _let_in(film, eye[2])
    return np.asarray(base + _mirrored(film, level, led, eye), np.float32)


def _let_in(film: Film, cosine: F4) -> F4:
    return let_in(np.maximum(cosine, LEAST), film.roughness, film.refraction)


def _mirrored(
    film: Film, normal: F4, light: F4, eye: F4, aside: F4 = NOT_ASIDE
) -> F4:
    """f_m from the light to the eye, in parts of base / pi; its mean where one of both moves by up
    to `aside` on either side."""
    half = light + eye
    c_i, c_o = np.maximum(_dot(normal, light), LEAST), np.maximum(_dot(normal, eye), LEAST)
    v_h = _dot(eye, half) / np.sqrt(_dot(half, half) + NEAREST)
    wide = np.float32(film.roughness)
    spread = _facets(film, normal, half, aside) * fresnel(v_h, film.refraction)
    hidden = masking(c_i, wide) * masking(c_o, wide)
    return np.asarray(np.float32(np.pi / 4 / film.base) * spread * hidden / (c_i * c_o), np.float32)


def _facets(film: Film, normal: F4, half: F4, aside: F4) -> F4:
    """Beckmann's density of microfacets that face `half`; its mean as `half` moves.

    In the plane of the microfacets' slopes, x = half_t / half_n, the density is a Gaussian, and so
    nearly is its mean over a way x' on either side: wider by 2 / 3 x'^2 along it.
    """
    size, rises, along = _dot(half, half) + NEAREST, _dot(normal, aside), _dot(normal, half)
    forwards = np.maximum(along, LEAST * np.sqrt(size))
    cosine, wide = forwards * forwards / size, np.float32(film.roughness**2)
    square, of = size - along * along, wide * forwards * forwards
    moved = of + np.float32(2 / 3) * (_dot(aside, aside) - rises * rises)
    sideways = _dot(half, aside) - along * rises
    falls = (np.float32(2 / 3) * sideways * sideways / moved - square) / of
    peak = np.float32(np.pi) * wide * np.sqrt(moved / of) * cosine * cosine
    return np.asarray(np.exp(falls) / peak, np.float32)


def _cross(a: F4, b: F4) -> F4:
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def _dot(a: F4, b: F4) -> F4:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
