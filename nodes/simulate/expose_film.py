"""Images of a film's light as a calibrated camera records them.

The noise is drawn by a counter, so that it does not depend on the device or on the order in which
pixels are computed (Philox: Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", 2011):
the key is the seed and the number of the image, the counter the number of the pixel, and each of
its four words makes two normal deviates (Box and Muller 1958).
"""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.graph import Close, Port, SizeLimit, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, Dark, Lens, Light, Noise, NoiseCorrelation
from tactograph.nodes.optics.between_cells import between_cells
from tactograph.nodes.optics.bicubic import between_pixels
from tactograph.nodes.optics.lens import ideal_places, is_straight

MAX_LEDS, PHILOX_WORDS = 8, 4
GRAIN_CELL_PX = 4
"""Side of the cells of correlated noise: those over which `noise_correlation` takes means."""
GRAIN_VARIANCE = 1 / (GRAIN_CELL_PX**2 * 0.59375**2)
"""Variance of the cells' deviates over that of the means over cells: a mean over interpolated
values has 0.59375 of the standard deviation along each axis."""
FRACTION_BITS = 23

Taken = Annotated[F4, Port("1", "1")]
"""Number of images of the stream so far."""


class Exposure(NamedTuple):
    """The images of the camera, and the number of images so far."""

    image: Light
    taken: Taken


@node(
    tolerance=Close(1e-4, share=5e-3, why="a value half-way between two steps; places of a lens"),
    sizes={"K": SizeLimit(1, MAX_LEDS, "a pixel's counter makes eight deviates")},
)
def expose_film(
    light: Light,
    flat: Light,
    noise: Noise,
    correlation: NoiseCorrelation | None = None,
    dark: Dark | None = None,
    lens: Lens | None = None,
    before: Taken | None = None,
    *,
    bits: Annotated[int, Interval(ge=1, le=16)] = 8,
    seed: Annotated[int, Interval(ge=0, le=2**32 - 1)] | None = None,
) -> Exposure:
    """Return dark + flat light, seen through the lens, with the camera's noise.

    Parameters
    ----------
    light : K x H x W, relative to the film at rest
    flat : K x H x W, the untouched film
    noise : of the images, in their units
    correlation
        Variance of a mean over pixels, relative to that with independent noise; without it the
        noise of neighbours is independent.
    dark : H x W, the image with all LEDs off
    lens : length 8; the images are those of the camera's pixels
    before
        The number of earlier images, `taken` of the previous item: no two have the same noise.
    bits : bit depth; 0 to 2^bits - 1 become 0 to 1
    seed : of the noise, the same for the same seed; None: no noise
    """
    number = np.zeros(1, np.float32) if before is None else before
    image = light * flat if dark is None else light * flat + dark
    if lens is not None and not is_straight(lens):
        places = ideal_places(lens, image.shape[1:])
        image = np.stack([between_pixels(plane, *places) for plane in image])
    if seed is not None:
        shot, read = noise
        deviates = _deviates(image.shape, seed, int(number[0]), correlation or 1.0)
        image = image + np.sqrt(shot * np.maximum(image, np.float32(0)) + read) * deviates
    steps = np.float32(2**bits - 1)
    return Exposure(np.rint(np.clip(image, 0, 1) * steps) / steps, number + np.float32(1))


def _deviates(shape: tuple[int, ...], seed: int, image: int, correlation: float) -> F4:
    """Return normal deviates of variance 1 for every pixel, and the part that neighbours share."""
    count, *size = shape
    pixels = _normal(count, size, [seed, 2 * image])
    if correlation <= 1:
        return pixels
    cells = _normal(count, [-(-side // GRAIN_CELL_PX) for side in size], [seed, 2 * image + 1])
    alike = np.float32(np.sqrt((correlation - 1) * GRAIN_VARIANCE))
    return pixels + alike * between_cells(cells, tuple(size), GRAIN_CELL_PX)


def _normal(count: int, size: list[int], key: list[int]) -> F4:
    """Return independent normal deviates, count x H x W."""
    words = np.random.Philox(key=key).random_raw(PHILOX_WORDS * size[0] * size[1])
    pairs = words.reshape(-1, PHILOX_WORDS).T[: -(-count // 2)].reshape(-1, *size)
    radius = np.sqrt(np.float32(-2) * np.log(_fraction(pairs)))
    turn = np.float32(2 * np.pi) * _fraction(pairs >> np.uint64(32))
    both = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    return both.reshape(-1, *size)[:count]


def _fraction(words: NDArray[np.uint64]) -> F4:
    """Return numbers between 0 and 1, without the ends, of the lower halves of words."""
    whole = (words.astype(np.uint32) >> np.uint32(32 - FRACTION_BITS)).astype(np.float32)
    return (whole + np.float32(0.5)) * np.float32(2.0**-FRACTION_BITS)


@expose_film.opencl()
def _launch(run: Launch) -> None:
    """Images without noise, the cells' deviates, then the camera's images of both."""
    inputs, settings, sizes = run.inputs, run.settings, [run.sizes[symbol] for symbol in "KHW"]
    count, *size = sizes
    clean, by_rows = run.scratch((count, *size)), run.in_row_lanes(*size)
    run.kernel(
        "clean_image", run.in_row_lanes(*sizes),
        inputs["light"], inputs["flat"], inputs.get("dark"), clean, *sizes,
    )  # fmt: skip
    noisy, alike, cells = settings["seed"] is not None, 0.0, None
    rows, columns = (-(-side // GRAIN_CELL_PX) for side in size)
    chance = inputs.get("before"), settings["seed"] or 0
    if noisy and (inputs.get("correlation") or 1) > 1:
        alike = float(np.sqrt((inputs["correlation"] - 1) * GRAIN_VARIANCE))
        cells = run.scratch((count, rows, columns))
        run.kernel("cell_deviates", run.in_row_lanes(rows, columns), *chance, cells,
                   count, rows, columns)  # fmt: skip
    run.kernel(
        "expose", by_rows, clean, inputs["noise"], inputs.get("lens"), *chance, cells,
        run.outputs["image"], run.outputs["taken"], *sizes, rows, columns, alike, int(noisy),
        2 ** settings["bits"] - 1,
    )  # fmt: skip


@expose_film.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, F4]:
    """A slightly distorting lens, some images into a stream."""
    lens = rng.uniform(-0.02, 0.02, 8).astype(np.float32)
    return {"lens": lens, "before": rng.integers(0, 1000, 1).astype(np.float32)}
