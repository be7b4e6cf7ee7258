"""Convert the light of a real film to the light of a matt film."""

from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np
from annotated_types import Interval

from tactograph.graph import Close, SizeLimit, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, Film, Height, Light, PixelSize, Slope
from tactograph.nodes.optics.cache_blocks import in_blocks
from tactograph.nodes.optics.coat import upload_curve
from tactograph.nodes.optics.film import (
    LIGHT_FIELDS,
    Place,
    direct_share,
    emitted,
    is_affine,
    place_seen,
    predict,
    rest_below,
    touch_gain,
    turned,
)
from tactograph.nodes.optics.near_light import (
    image_places,
    lights_around,
    unwrapped,
    vectors_at,
    wrapped,
)
from tactograph.nodes.optics.normals import normals_of

STRETCH_PX = 64
"""Pixels of a row per work-item on a CPU, about a kilobyte of data for each LED."""
Thrown = TypeVar("Thrown")
"""The light from film to film, on the host or on a device."""
NOISY_LIGHT_FIELDS = (*LIGHT_FIELDS, "grain")
"""The fields of `Film` on which light and its deviation depend."""


class MattLight(NamedTuple):
    """The light of a matt film under the same LEDs, and its standard deviation."""

    light: Light
    sigma: Light


@node(
    tolerance=Close(5e-3, 5e-3, share=5e-3, why="light hardly distinguishes steep normals"),
    sizes={"K": SizeLimit(3, 8, "two LEDs leave two slopes, a label has 8 bits")},
)
def matt_light(
    light: Light,
    sigma: Light,
    slope: Slope,
    height: Height,
    film: Film,
    pixel: PixelSize,
    bounced: Light | None = None,
    finer: Light | None = None,
    finest: Light | None = None,
    rest: Height | None = None,
    *,
    steps: Annotated[int, Interval(ge=0, le=8)] = 2,
    uncoated_steps: Annotated[int, Interval(ge=0, le=8)] = 2,
    penumbras: bool = False,
) -> MattLight:
    """Return the light that a matt film of the same shape would have.

    With F the light that the film model predicts (`film`, F1) and n.v that of a matt film
    (`near_light`, N1), ``m' = (m - F(n)) / (s (1 - b) a) + max(n.v, 0)`` (F4).  Unless the light
    depends on the normal like a matt film's, this needs a normal.  Gauss-Newton steps find it from
    the expected slope, with the LEDs that light the pixel.  An error of that normal matters only as
    far as F and n.v depend on it differently.  In a shadow, which contains diffused light, m' is
    about 0.  All nodes for shadows and matt light are then valid for any film.

    Parameters
    ----------
    light, sigma : K x H x W, relative to the film at rest, and its standard deviation
    slope, height : 2 x H x W, and H x W in mm, estimates
    film : the LEDs' and the film's properties
    pixel : mm per px
    bounced : K x H x W, the light from film to film (`film_bounce`)
    finer, finest : K x H x W, the results of finer passes, which replace `bounced` if they have run
    rest : H x W in mm, the seen height of the film at rest; None: a plane
    steps : Gauss-Newton steps of the normal on a coated film
    uncoated_steps : Gauss-Newton steps on a film without a coat, whose harmonics vary gently
    penumbras
        Whether an LED counts less the less of the light arrives that the expected slope predicts,
        since a shadow may reach the pixel in part; for slopes that are nearly known

    Returns
    -------
    Both K x H x W; the standard deviation includes the film's grain.
    """
    thrown = _finest(finest, finer, bounced)
    direct = light if thrown is None else light - thrown
    lifted = height if rest is None else height - rest
    flat = tuple(a.reshape(*a.shape[:-2], -1) for a in (direct, sigma, slope, height, lifted))
    x, y = map(np.ravel, np.broadcast_arrays(*image_places(height.shape, pixel)))
    planes = np.empty_like(flat[0]), np.empty_like(flat[1])

    turns = steps if film.refraction != 1 else uncoated_steps

    def convert(part: slice) -> None:
        m, spread, expected, z, lift = (a[..., part] for a in flat)
        place = place_seen(film, x[part], y[part], z)
        scale = _scale(film, place, lift)
        if is_affine(film):
            converted = (m - touch_gain(film, lift) * film.diffuse[:, None]) * scale
        else:
            above = None if rest is None else lift
            n, at_rest = normals_of(expected), rest_below(film, *place)
            for _ in range(turns):
                n = turned(film, m, n, place, rest=at_rest, lift=above, penumbras=penumbras)
            residual = m - predict(film, n, *place, at_rest, above)
            vectors = vectors_at(film.lights, x[part], y[part], z)
            converted = residual * scale + wrapped(np.einsum("kcn,cn->kn", vectors, n), film.wrap)
        grain = np.float32(film.grain) * m
        noise = np.sqrt(spread * spread + grain * grain) * scale
        matt = np.asarray(converted, np.float32)
        planes[0][:, part], planes[1][:, part] = unwrapped(matt, noise, film.wrap)

    in_blocks(convert, height.size)
    return MattLight(*(plane.reshape(light.shape) for plane in planes))


def _finest(*passes: Thrown | None) -> Thrown | None:
    """The light of the first of these passes that has run."""
    return next((each for each in passes if each is not None), None)


@matt_light.opencl()
def _launch(run: Launch) -> None:
    count, height, width = (run.sizes[symbol] for symbol in "KHW")
    inputs, out = run.inputs, run.outputs
    stretch = STRETCH_PX if run.lanes > 1 else 1
    thrown = _finest(*map(inputs.get, ("finest", "finer", "bounced")))
    film = [inputs[f"film.{name}"] for name in NOISY_LIGHT_FIELDS]
    film.insert(4, upload_curve(run, inputs["film.roughness"], inputs["film.refraction"]))
    run.kernel(
        "matt_light", (height * -(-width // stretch),),
        inputs["light"], inputs["sigma"], inputs["slope"], inputs["height"],
        *film, inputs["pixel"], thrown, inputs.get("rest"),
        out["light"], out["sigma"], count, height, width, run.settings["steps"],
        run.settings["uncoated_steps"],
        local=run.alone, constants={"PENUMBRAS": int(run.settings["penumbras"])},
    )  # fmt: skip


@matt_light.idle
def _is_matt(
    film_diffuse: F4,
    film_wrap: float,
    film_harmonics: F4,
    film_gain: float,
    film_refraction: float,
    film_camera: float,
    film_grain: float,
    film_emission: float,
    bounced: Light | None = None,
    finer: Light | None = None,
    finest: Light | None = None,
) -> bool:
    """Return whether the film is matt, so that its light needs no conversion."""
    more = film_wrap, film_camera, film_grain, film_emission
    uneven = film_diffuse.any() or film_harmonics.any()
    return film_gain == film_refraction == 1 and not uneven and not any(more)


@matt_light.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """Plausible light of a film."""
    light = rng.uniform(0.3, 1.4, (K, H, W)).astype(np.float32)
    return example_film(rng, K, H, W) | {"light": light}


def example_film(rng: np.random.Generator, K: int, H: int, W: int) -> dict[str, Any]:
    """A film of any slope and LEDs around it: one in three is matt, every other one has a soft
    light."""
    matt = {"film.refraction": 1.0, "film.camera": 0.0, "film.harmonics": np.zeros((K, 8, 6), "f4")}
    return (matt if rng.random() < 1 / 3 else {}) | {
        "film.lights": lights_around(rng, K),
        "film.wrap": float(rng.choice([0, rng.uniform(0.1, 0.3)])),
        "slope": rng.uniform(-0.8, 0.8, (2, H, W)).astype(np.float32),
    }


def _scale(film: Film, place: Place, lift: F4) -> F4:
    """1 / (s (1 - b) a) of equation F1: K x N."""
    scale = np.empty((len(film.lights), lift.size), np.float32)
    for k, direct in enumerate(direct_share(film)):
        scale[k] = 1 / (touch_gain(film, lift) * direct * emitted(film, k, place))
    return scale
