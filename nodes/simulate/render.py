"""Light a surface with one LED at a time and render the images that a sensor would take.

Long because one node is one algorithm: rays, lobe, coat and occlusion, as in its kernel.
"""

import itertools
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Interval
from numpy.typing import NDArray

from tactograph.graph import Close, InputError, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, Height, Labels, Light, LightPositions, PixelSize
from tactograph.nodes.optics.bilinear import bilinear
from tactograph.nodes.optics.coat import (
    MIN_COSINE,
    beckmann,
    fresnel,
    let_in_by,
    let_in_curve,
    masking,
    upload_curve,
)
from tactograph.nodes.optics.difference import difference
from tactograph.nodes.optics.film import to_pupil

B1 = NDArray[np.bool_]
I4 = NDArray[np.int32]

GOLDEN_ANGLE = 2.3999631
"""Radians between neighbouring points of a sunflower spiral, which fills a disk evenly."""
LIFT_PX = 1e-3
"""Height of a ray's start above the surface in pixel sizes, so that it misses its own pixel."""


MIN_COAT_COSINE = np.float32(1e-3)
"""Smallest cosine towards LED, camera and half vector for which a coat is computed."""


class Rendered(NamedTuple):
    """The image under each LED, and the pixels that it does not reach."""

    light: Light
    labels: Labels


class _Surface(NamedTuple):
    """The height field and its slopes (p, q), each H x W; `top` is its highest point."""

    z: F4
    p: F4
    q: F4
    pixel: np.float32
    top: np.float32

    @property
    def size(self) -> tuple[int, int]:
        rows, columns = self.z.shape
        return rows, columns


class _Spots(NamedTuple):
    """One point of every pixel, each H x W: its position in px and in mm, and its slope."""

    column: F4
    row: F4
    x: F4
    y: F4
    z: F4
    p: F4
    q: F4
    norm: F4


class Coat(NamedTuple):
    """A rough dielectric over the film, and the camera that sees it.

    Parameters
    ----------
    coat_alpha : roughness of a coat, Beckmann's alpha; 0 is a film without a coat
    refractive_index : refractive index of the coat
    albedo : share of the light that the film under the coat reflects
    camera_mm
        Distance of the camera's pupil, which sees the coat, from the film at rest; 0 is
        infinitely far away.
    """

    coat_alpha: Annotated[float, Interval(ge=0, le=1)] = 0.0
    refractive_index: Annotated[float, Interval(ge=1.01, le=3)] = 1.5
    albedo: Annotated[float, Interval(ge=0.01, le=1)] = 0.7
    camera_mm: Annotated[float, Ge(0)] = 0.0


class _Film(NamedTuple):
    """Emission of the LEDs, reflection of the film, and tracing of shadows."""

    gloss: float
    shininess: float
    step_px: float
    cosine_leds: bool
    coat: Coat


class _Rays(NamedTuple):
    """Rays from every pixel to one point of an LED: H x W, mm."""

    x: F4
    y: F4
    z: F4
    length: F4


@node(
    tolerance=Close(
        2e-5,
        2e-4,
        share=2e-3,
        why="a ray that grazes an edge, or a surface edge-on to the light, may fall either way",
    )
)
def render(
    height: Height,
    pixel: PixelSize,
    lights: LightPositions,
    *,
    level: Annotated[float, Interval(gt=0, le=1)] = 0.75,
    gloss: Annotated[float, Ge(0)] = 0.0,
    shininess: Annotated[float, Gt(0)] = 30.0,
    led_size_mm: Annotated[float, Ge(0)] = 0.0,
    rays: Annotated[int, Interval(ge=1, le=256)] = 16,
    samples: Annotated[int, Interval(ge=1, le=8)] = 1,
    step_px: Annotated[float, Interval(gt=0, le=1)] = 0.5,
    cosine_leds: bool = False,
    coat: Coat,
) -> Rendered:
    """Return the image under each LED and the pixels it does not reach.

    The film is Lambertian (section 3: I = albedo * n.L), with optional gloss or coat, and seen
    from straight above: every pixel shows the film's point below it (`view` converts this to
    the view of a near camera).  A near LED lights each pixel from a different direction, and
    its light falls off with the inverse square of the distance.  The normal comes from central
    differences, one-sided at the border.  In an attached shadow the surface faces away from the
    LED.  In a cast shadow the ray from the pixel towards the LED, followed over the bilinearly
    interpolated height, meets the surface.  Film outside the image casts no shadow.

    A coat is a rough dielectric.  With c_i and c_o the cosines towards LED and camera, F
    Fresnel's reflectance, D Beckmann's distribution, G its shadowing (Walter et al. 2007) and
    h half-way between both directions, it replaces n.L by::

        c_i T(c_i) T(c_o) + pi / albedo  F(v.h) D(alpha) G / (4 c_o)

    Parameters
    ----------
    height : H x W, mm above the film at rest
    pixel : mm per pixel
    lights : K x 3, LED positions in mm from pixel ((W-1)/2, (H-1)/2) of the film at rest
    level
        Exposure: light of the film at rest at its brightest point in the image, under the LED
        that is brightest there.  Slopes that face an LED are brighter.
    gloss
        Strength of a Blinn-Phong highlight, as a share of the Lambertian reflectance; ignored
        for a film with a coat.
    shininess : exponent of the highlight; a higher one is smaller and sharper
    led_size_mm
        Diameter of the LEDs, which are disks parallel to the film; 0 is a point with hard
        shadows.
    rays : rays per pixel to an LED of finite size; they produce its soft shadows
    samples
        Points per pixel along x and along y, which are averaged.  From 2 on, pixels on a
        shadow's edge mix light and shadow, as in a camera.  Time grows with the square.
    step_px : step of the ray over the height field, in pixels
    cosine_leds
        Whether the LEDs' disks face the middle of the film and emit by the cosine law, instead
        of lying parallel to the film and emitting uniformly.

    Returns
    -------
    Light K x H x W, and labels H x W with bit k-1 set where fewer than half the rays reach
    LED k.

    Raises
    ------
    InputError
        If an LED is not above the surface's highest point (NumPy only; the kernel cannot refuse
        and renders such an LED anyway).
    """
    p, q = (difference(height, axis) / np.float32(pixel) for axis in (1, 0))
    surface = _Surface(height, p, q, np.float32(pixel), height.max())
    _check_above(lights, surface.top)
    film = _Film(gloss, shininess, step_px, cosine_leds, coat)
    gain = _gain(lights, height.shape, surface.pixel, level)
    offsets = (np.arange(samples, dtype=np.float32) + np.float32(0.5)) / np.float32(samples)
    offsets -= np.float32(0.5)
    spots = [_spot(surface, dx, dy) for dy in offsets for dx in offsets]
    light = np.empty((len(lights), *height.shape), np.float32)
    labels = np.zeros(height.shape, np.uint8)
    for k, led in enumerate(lights):
        number = rays if led_size_mm > 0 else 1
        points = _points(led, number, np.float32(led_size_mm), cosine_leds)
        radiance, reached = _lit_from(surface, spots, led, points, film)
        count = len(spots) * len(points)
        light[k] = gain * radiance / np.float32(count)
        labels |= np.where(2 * reached < count, 1 << k, 0).astype(np.uint8)
    return Rendered(light, labels)


@render.opencl()
def _launch(launch: Launch) -> None:
    size = launch.sizes["H"], launch.sizes["W"]
    height, pixel, lights = (launch.inputs[name] for name in ("height", "pixel", "lights"))
    rows, ends = launch.scratch((2 * size[0],)), launch.scratch((2,))
    launch.kernel("row_ends", size[:1], height, rows, *size)
    launch.kernel("ends", (1,), rows, ends, size[0])
    images = launch.outputs["light"], launch.outputs["labels"]
    sizes = *size, launch.sizes["K"]
    coat = launch.settings["coat_alpha"], launch.settings["refractive_index"]
    curve = upload_curve(launch, *coat) if coat[0] > 0 else None
    settings = (launch.settings[name] for name in render.parameters)
    launch.kernel("render", size, height, pixel, lights, ends, curve, *images, *sizes, *settings)


@render.example
def _example(rng: np.random.Generator, K: int, **sizes: int) -> dict[str, F4]:
    """LEDs in front of every height that a test draws."""
    sideways = rng.uniform(-20, 20, (K, 2))
    return {"lights": np.column_stack([sideways, rng.uniform(15, 40, K)]).astype(np.float32)}


def _lit_from(
    surface: _Surface, spots: list[_Spots], led: F4, points: list[F4], film: _Film
) -> tuple[F4, I4]:
    """Return the summed radiance from the points of an LED, and how many of them reach."""
    total = np.zeros(surface.size, np.float32)
    reached = np.zeros(surface.size, np.int32)
    for spot, point in itertools.product(spots, points):
        x, y, z = point[0] - spot.x, point[1] - spot.y, point[2] - spot.z
        ray = _Rays(x, y, z, np.sqrt(x * x + y * y + z * z))
        # n.L, negative in an attached shadow (section 3.3).
        cosine = (ray.z - spot.p * ray.x - spot.q * ray.y) / (spot.norm * ray.length)
        lit = cosine > 0
        lit[lit] = _unobstructed(surface, spot, ray, lit, film)
        coated = film.coat.coat_alpha > 0
        radiance = (
            _coat(spot, ray, cosine, film) if coated else cosine + _highlight(spot, ray, film)
        )
        falloff = 1.0 / (ray.length * ray.length)
        if film.cosine_leds:
            # The LED's disk emits by the cosine between the ray and its axis.
            x, y, z = led / np.sqrt((led * led).sum())
            emitted = (x * ray.x + y * ray.y + z * ray.z) / ray.length
            falloff = falloff * np.maximum(emitted, np.float32(0))
        total += np.where(lit, radiance * falloff, np.float32(0))
        reached += lit
    return total, reached


def _spot(surface: _Surface, dx: np.float32, dy: np.float32) -> _Spots:
    rows, columns = surface.size
    row, column = np.indices(surface.size).astype(np.float32)
    column = np.clip(column + dx, np.float32(0), np.float32(columns - 1))
    row = np.clip(row + dy, np.float32(0), np.float32(rows - 1))
    z, p, q = (bilinear(part, column, row) for part in (surface.z, surface.p, surface.q))
    x = (column - np.float32(0.5 * (columns - 1))) * surface.pixel
    y = (row - np.float32(0.5 * (rows - 1))) * surface.pixel
    return _Spots(column, row, x, y, z, p, q, np.sqrt(1 + p * p + q * q))


def _check_above(lights: F4, top: np.float32) -> None:
    for k, z in enumerate(lights[:, 2], start=1):
        if z <= top:
            raise InputError(
                f"render: LED {k} stands {z:g} mm above the film at rest and the surface rises "
                f"to {top:g} mm; raise the LED or lower the surface"
            )


def _gain(lights: F4, size: tuple[int, ...], pixel: np.float32, level: float) -> np.float32:
    """The exposure: `level` divided by the flat film's largest irradiance inside the image.

    The maximum lies at the image point nearest to the LED's foot.
    """
    brightest = np.float32(0)
    for x, y, z in lights:
        dx, dy = _outside(x, size[1], pixel), _outside(y, size[0], pixel)
        square = dx * dx + dy * dy + z * z
        brightest = np.maximum(brightest, z / (square * np.sqrt(square)))
    return np.float32(level) / brightest


def _outside(foot: np.float32, size: int, pixel: np.float32) -> np.float32:
    """Distance of a coordinate from the image in mm; 0 inside."""
    return np.maximum(np.abs(foot) - np.float32(0.5 * (size - 1)) * pixel, np.float32(0))


def _points(led: F4, count: int, size_mm: np.float32, facing: bool) -> list[F4]:
    """`count` points spread evenly over an LED's disk, in opposite pairs.

    Their mean is the centre, where the point left over from an odd count lies.  The disk faces
    the middle of the film, or lies parallel to the film.
    """
    odd = count % 2
    i = np.arange(count) + odd
    pair = (i // 2).astype(np.float32)
    inside = (2 * pair + np.float32(1 - odd)) / np.float32(count)
    radius = np.float32(0.5) * size_mm * np.sqrt(inside) * np.where(i % 2, -1, 1)
    angle = pair * np.float32(GOLDEN_ANGLE)
    u, v = radius * np.cos(angle), radius * np.sin(angle)
    if not facing:
        return list(led + np.stack([u, v, np.zeros_like(i)], axis=1))
    across, along = _disk(led)
    return list(led + u[:, None] * across + v[:, None] * along)


def _disk(led: F4) -> tuple[F4, F4]:
    """Two unit vectors in the plane of a disk that faces the middle of the film."""
    x, y, z = led
    plan, far = np.sqrt(x * x + y * y), np.sqrt(x * x + y * y + z * z)
    c, s = (x / plan, y / plan) if plan > 0 else (np.float32(1), np.float32(0))
    across = np.array([-s, c, 0], np.float32)
    return across, np.array([c * z / far, s * z / far, -plan / far], np.float32)


def _highlight(spot: _Spots, ray: _Rays, film: _Film) -> F4:
    """Blinn-Phong: (n.h)^shininess, h half-way between the light and the camera above."""
    if film.gloss == 0:
        return np.zeros_like(spot.z)
    hx, hy, hz = ray.x / ray.length, ray.y / ray.length, ray.z / ray.length + 1
    norm = spot.norm * np.sqrt(hx * hx + hy * hy + hz * hz)
    cosine = (hz - spot.p * hx - spot.q * hy) / norm
    return np.float32(film.gloss) * np.maximum(cosine, np.float32(0)) ** np.float32(film.shininess)


def _coat(spot: _Spots, ray: _Rays, cosine: F4, film: _Film) -> F4:
    """The replacement of n.L under a rough dielectric coat, seen from the pupil."""
    lx, ly, lz = ray.x / ray.length, ray.y / ray.length, ray.z / ray.length
    pupil = film.coat.camera_mm
    vx, vy, vz = to_pupil(1 / pupil if pupil else 0.0, spot.x, spot.y, spot.z)
    view_cosine = np.maximum((vz - spot.p * vx - spot.q * vy) / spot.norm, MIN_COAT_COSINE)
    lit = np.maximum(cosine, MIN_COAT_COSINE)
    hx, hy, hz = lx + vx, ly + vy, lz + vz
    length = np.sqrt(hx * hx + hy * hy + hz * hz)
    upright = np.maximum((hz - spot.p * hx - spot.q * hy) / (spot.norm * length), MIN_COAT_COSINE)
    between = (vx * hx + vy * hy + vz * hz) / length
    alpha, index = film.coat.coat_alpha, film.coat.refractive_index
    mirrored = beckmann(upright, alpha) * fresnel(between, index)
    mirrored = mirrored * masking(lit, alpha) * masking(view_cosine, alpha)
    through = let_in_by(let_in_curve(alpha, index), np.maximum([lit, view_cosine], MIN_COSINE))
    matt = cosine * through[0] * through[1]
    return np.asarray(
        matt + mirrored * np.float32(np.pi / (4 * film.coat.albedo)) / view_cosine, np.float32
    )


def _unobstructed(surface: _Surface, spot: _Spots, ray: _Rays, mask: B1, film: _Film) -> B1:
    """Follow the rays of the wanted pixels; return which of them do not meet the surface.

    All undecided rays advance together step by step, so that NumPy works on long arrays.
    """
    rows, columns = surface.size
    x, y = spot.column[mask], spot.row[mask]
    start = spot.z[mask] + np.float32(LIFT_PX) * surface.pixel
    dx, dy, dz = ray.x[mask], ray.y[mask], ray.z[mask]
    across: F4 = np.maximum(np.sqrt(dx * dx + dy * dy), np.float32(1e-6))
    step = np.float32(film.step_px)
    dx, dy, dz = dx / across * step, dy / across * step, dz / across * step * surface.pixel
    # A ray ends at the LED.
    last: F4 = across / (step * surface.pixel)

    free = np.ones(x.size, bool)
    open_ = np.arange(x.size)
    i = np.float32(0)
    while open_.size:
        i += np.float32(1)
        px, py, pz = x + i * dx, y + i * dy, start + i * dz
        inside = (px >= 0) & (px <= columns - 1) & (py >= 0) & (py <= rows - 1)
        alive = inside & (pz <= surface.top) & (i < last)
        keep = np.nonzero(alive)[0]
        hit = bilinear(surface.z, px[keep], py[keep]) > pz[keep]
        free[open_[keep[hit]]] = False
        keep = keep[~hit]
        open_ = open_[keep]
        x, y, start, last = x[keep], y[keep], start[keep], last[keep]
        dx, dy, dz = dx[keep], dy[keep], dz[keep]
    return free
