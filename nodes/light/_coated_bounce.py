"""What a coated film throws on itself: in `film_bounce` it takes the place of a matt film.

A matt base lights all around; under a coat it does so less at grazing angles, on the way in and on
the way out.  The coat mirrors, too: light of the LEDs on to other places of the film, and light
of other places into the camera.  With T and the mirrored part f_m of equation F2 (`_film`), cell j
sends to P, under LED k,

    e_kj = (E_j r_k - E_jk f_m(l, v)) T(to P) / T(v) + E_jk f_m(l, to P)

where E_j r_k is what the camera sees of it, f_m in parts of base / pi, and P throws back

    B(P) = albedo sum_j max(n.d, 0) max(-S_j.d, 0) / (pi |d|^4) [T(d) T(v) + f_m(d, v)] e_kj / r_k.

r_k is the reflectance of the film at rest.  Of a cell that shows less light than the LED alone
would give it, a shadow takes the rest, and as much of what the coat mirrors.  Light that the coat
mirrors twice between cells before it reaches the camera is in what the camera sees.
``kernels/headers/coated_bounce.clh`` holds the same.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tactograph.nodes import F4, Film
from tactograph.nodes.light._coat import let_in
from tactograph.nodes.light._film import GRAZING, direct_share, glint, to_pupil
from tactograph.nodes.light._radiosity import NEAREST, Arriving

LEAST = np.float32(GRAZING)


class _Surface(NamedTuple):
    """Places of a film, each 3 x N: normals, directions to the pupil; T along those, N."""

    at: F4
    normal: F4
    eye: F4
    to_eye: F4
    let_out: F4


def coated_arriving(film: Film, from_above: bool = False) -> Arriving:
    """Return what takes the place of `matt_arriving` on a film with a coat.

    Light is relative to the film at rest that the same pixel sees, or to that below (`from_above`).
    """
    at_rest = film._replace(camera=0.0) if from_above else film

    def rest(light: F4, at: F4) -> F4:
        nearer = 1 - np.float32(at_rest.camera) * at[2]
        return _at_rest(film, light, at[:2] / nearer)

    def arriving(at: F4, normal: F4, places: F4, areas: F4, sources: F4) -> F4:
        here, there = _surface(film, at, normal), _surface(film, places, areas)
        emitted, mirrored = _emitted(film, there, sources, rest)
        away = there.at[:, None, :] - here.at[:, :, None]
        square = (away * away).sum(0) + NEAREST
        away /= np.sqrt(square)
        size = np.sqrt((areas * areas).sum(0))
        c_in = np.maximum(_dot(here.normal[:, :, None], away), 0)
        c_out = np.maximum(-_dot(there.normal[:, None, :], away), 0)
        thrown = here.let_out[:, None] * _let_in(film, c_in)
        thrown += _mirrored(film, here.normal[:, :, None], away, here.eye[:, :, None])
        thrown *= c_in * c_out * size / square
        let_out = _let_in(film, c_out)
        found = np.empty((len(sources), at.shape[1]), np.float32)
        for k, light in enumerate(film.lights):
            led = light[:, None] - there.at
            led /= np.sqrt((led * led).sum(0))
            lobe = _mirrored(film, there.normal[:, None, :], led[:, None, :], -away)
            sent = emitted[k] * let_out + mirrored[k] * lobe
            found[k] = (thrown * sent).sum(1) / rest(light, here.at)
        return found

    return arriving


def source_rows(leds: int) -> int:
    """Return the rows of the kernels' table of sources: SOURCE_ROWS."""
    return 7 + 5 * leds


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


def _mirrored(film: Film, normal: F4, light: F4, eye: F4) -> F4:
    """f_m from the light to the eye, in parts of base / pi."""
    half = light + eye
    unit = 1 / np.sqrt((half * half).sum(0) + NEAREST)
    c_i, c_o = np.maximum(_dot(normal, light), LEAST), np.maximum(_dot(normal, eye), LEAST)
    c_h, v_h = np.maximum(_dot(normal, half) * unit, LEAST), _dot(eye, half) * unit
    return np.asarray(np.float32(np.pi / film.base) * glint(film, c_i, c_o, c_h, v_h), np.float32)


def _dot(a: F4, b: F4) -> F4:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
