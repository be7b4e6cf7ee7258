"""The light of a calibrated film of any shape: the forward model of a calibration."""

from typing import Any

import numpy as np

from tactograph.graph import Close, SizeLimit, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import Film, Height, Labels, Light, PixelSize, Slope
from tactograph.nodes.light.matt_light import STRETCH_PX, example_film
from tactograph.nodes.optics.cache_blocks import in_blocks
from tactograph.nodes.optics.coat import upload_curve
from tactograph.nodes.optics.film import LIGHT_FIELDS, emitted, place_seen, predict, touch_gain
from tactograph.nodes.optics.near_light import image_places
from tactograph.nodes.optics.normals import normals_of


@node(
    tolerance=Close(2e-3, 2e-3, why="a coat's light at grazing angles"),
    sizes={"K": SizeLimit(1, 8, "a label has 8 bits")},
)
def film_light(
    slope: Slope,
    height: Height,
    film: Film,
    pixel: PixelSize,
    shadow: Labels | None = None,
    rest: Height | None = None,
) -> Light:
    """Return the light of a film relative to a plane film at rest (equation F1).

    In a cast shadow only the light remains that the gel diffuses: s (b - (1 - b) w) of
    equation F1.

    Parameters
    ----------
    slope : 2 x H x W, of the film
    height : H x W in mm, as the camera sees it (`view_slope`)
    film : the LEDs' and the film's properties
    pixel : mm per px
    shadow : H x W, the LEDs in whose shadow a pixel is, from `cast_shadows`
    rest : H x W in mm, the film at rest as the camera sees it; None: a plane
    """
    x, y = map(np.ravel, np.broadcast_arrays(*image_places(height.shape, pixel)))
    slopes, heights = slope.reshape(2, -1), height.ravel()
    low = None if rest is None else rest.ravel()
    planes = np.empty((len(film.lights), height.size), np.float32)

    def light(part: slice) -> None:
        place = place_seen(film, x[part], y[part], heights[part])
        lift = place[2] if low is None else heights[part] - low[part]
        planes[:, part] = predict(film, normals_of(slopes[:, part]), *place, None, lift)
        if shadow is not None:
            for k, b in enumerate(film.diffuse):
                scattered = np.float32(film.wrap) * emitted(film, k, place)
                shaded = touch_gain(film, lift) * (b - (1 - b) * scattered)
                dark = shadow.ravel()[part] >> k & 1
                planes[k, part] = np.where(dark > 0, shaded, planes[k, part])

    in_blocks(light, height.size)
    return planes.reshape(-1, *height.shape)


@film_light.opencl()
def _launch(run: Launch) -> None:
    count, height, width = (run.sizes[symbol] for symbol in "KHW")
    inputs, stretch = run.inputs, STRETCH_PX if run.lanes > 1 else 1
    film = [inputs[f"film.{name}"] for name in LIGHT_FIELDS]
    film.insert(4, upload_curve(run, inputs["film.roughness"], inputs["film.refraction"]))
    run.kernel(
        "film_light", (height * -(-width // stretch),),
        inputs["slope"], inputs["height"], *film, inputs["pixel"],
        inputs.get("shadow"), inputs.get("rest"), run.outputs["film_light"],
        count, height, width,
        local=run.alone,
    )  # fmt: skip


@film_light.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """The film on which `matt_light` is tested."""
    return example_film(rng, K, H, W)
