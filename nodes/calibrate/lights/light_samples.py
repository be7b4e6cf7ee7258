"""Samples of known shapes under the LEDs, and the flat frame in blocks."""

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, map_coordinates

from tactograph.nodes import F4, F8, U1, Film, Height, Labels, Light, Mask, Slope
from tactograph.nodes.calibrate import MAX_SAMPLE_SLOPE, MIN_PIXELS
from tactograph.nodes.calibrate.rating.verdict import MAX_INDEPENDENT_REST
from tactograph.nodes.optics.coat import MIN_COSINE
from tactograph.nodes.optics.film import led_axis
from tactograph.nodes.optics.near_light import places
from tactograph.nodes.optics.rest_shape import RestShape
from tactograph.nodes.optics.sheet import cut

FLAT_BLOCKS = 32
"""Number of square blocks along the image in which the (smooth) flat frame is averaged."""
MAX_SAMPLES = 3000
"""Pixels of an object that suffice to fit twenty unknowns to a thousandth."""
MAX_SAMPLES_EACH = 500
"""Pixels that suffice for each of several objects, or for one that is only compared."""
LIGHT_DEVIATION = 0.006
"""Expected standard deviation of the light."""
DIM_LIGHT = 0.05
"""Light below this may be half shadow."""
EDGE_MARGIN_PX = 3
"""Width in px of the known shape's edge that is left out, since a shift could move it outside."""


class Press(NamedTuple):
    """A known shape, H x W: light, slope, mask where they hold, height, and LEDs that reach it."""

    light: Light
    slope: Slope
    mask: Mask
    height: Height
    lit: Labels

    def samples(
        self, pixel: float, most: float = MAX_SAMPLES, shape: RestShape | None = None
    ) -> "Object":
        """Choose about `most` samples of an object, spread evenly over it."""
        light, slope, mask, height, lit = self
        p, q = slope
        nz = 1 / np.sqrt(1 + p * p + q * q)
        inside = binary_erosion(mask > 0, iterations=EDGE_MARGIN_PX, border_value=1)
        rows, columns = np.nonzero(inside & (p * p + q * q < MAX_SAMPLE_SLOPE * MAX_SAMPLE_SLOPE))
        stride = max(1, int(np.sqrt(rows.size / most)))
        chosen = (rows % stride == 0) & (columns % stride == 0)
        rows, columns = rows[chosen], columns[chosen]
        values = light[:, rows, columns].astype(np.float64)
        numbers = np.arange(len(light))[:, None]
        reached = (lit[rows, columns][None, :] >> numbers & 1 > 0) & (values > DIM_LIGHT)
        x = places(light.shape[2], np.float32(pixel)).astype(np.float64)[columns]
        y = places(light.shape[1], np.float32(pixel)).astype(np.float64)[rows]
        reach = reached.sum(axis=1) * stride * stride
        normal = np.stack([-p * nz, -q * nz])
        beneath = None if shape is None else shape.at(x, y)
        return Object(rows, columns, values, reached, x, y, normal, height, reach, beneath)


@dataclass(frozen=True)
class Object:
    """Samples of a known shape: N positions, the light there (K x N) and whether it counts.

    `reach` is the number of pixels that each LED reaches, including the samples' neighbours.
    `beneath` are normal, x, y and z of the film at rest that the same pixels see; None: a plane.
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    light: F8
    lit: NDArray[np.bool_]
    x: F8
    y: F8
    normal: F4
    height: F4
    reach: NDArray[np.intp]
    beneath: tuple[F8, F8, F8, F8] | None = None

    def moved(self, shift: F8) -> tuple[F8, F8]:
        """Unit normals 3 x N and heights N of the shape moved by `shift` = (x, y, z) in px, mm."""
        where = np.stack([self.rows - shift[1], self.columns - shift[0]])
        # n_x and n_y are linear on a ball, so interpolating them (not the slope) is exact.
        nx, ny, z = (
            map_coordinates(plane, where, output=np.float64, order=1, mode="nearest")
            for plane in (*self.normal, self.height)
        )
        nz = np.sqrt(np.maximum(1 - nx * nx - ny * ny, 1e-4))
        return np.stack([nx, ny, nz]), z + shift[2]


@dataclass(frozen=True)
class Rest:
    """The flat frame: logarithm of block means, minus its mean over the LEDs; K x N.

    x and y are where blocks are seen on a plane, `beneath` normal, x, y and z of film that is none,
    and `bounced` the light, K x N, that it throws on itself with an albedo of 1.
    """

    logarithm: F8
    x: F8
    y: F8
    block: int
    beneath: tuple[F8, F8, F8, F8] | None = None
    bounced: F8 | None = None

    @classmethod
    def of(
        cls, flat: Light, pixel: float, shape: RestShape | None = None, bounced: Light | None = None
    ) -> Self | None:
        """Reduce the flat frame to blocks; None if it is uniform, because none was taken.

        `shape` is that of a film that is no plane, `bounced` the light that it throws on itself.
        """
        if is_uniform(flat):
            return None
        count, rows, columns = flat.shape
        block = max(1, min(columns // FLAT_BLOCKS, rows))
        down, across = rows // block, columns // block

        def blocks(light: Light) -> F8:
            cut = light[:, : down * block, : across * block]
            whole = cut.reshape(count, down, block, across, block)
            return np.asarray(whole.mean(axis=(2, 4), dtype=np.float64))

        means = np.log(np.maximum(blocks(flat), 1e-6))
        middle = (block - 1) / 2
        x = (np.arange(across) * block + middle - (columns - 1) / 2) * pixel
        y = (np.arange(down) * block + middle - (rows - 1) / 2) * pixel
        gx, gy = np.meshgrid(x, y)
        logarithm, x, y = (means - means.mean(axis=0)).reshape(count, -1), gx.ravel(), gy.ravel()
        thrown = None if bounced is None else blocks(bounced).reshape(count, -1)
        beneath = None if shape is None else shape.at(x, y)
        return cls(logarithm, x, y, block, beneath, thrown)

    def emitted(self, film: Film) -> F8:
        """Return the logarithm of what the LEDs emit to it, K x N, over that along their axes."""
        logarithms = []
        for k, light in enumerate(film.lights.astype(np.float64)):
            axis, way = led_axis(film, k), light - np.stack([self.x, self.y, 0 * self.x], 1)
            cosine = way @ axis / (np.linalg.norm(axis) * np.linalg.norm(way, axis=1))
            logarithms.append(film.emission * np.log(np.maximum(cosine, MIN_COSINE)))
        return np.stack(logarithms)

    def under_points(self, film: Film) -> Self:
        """Return the frame as under LEDs in the same places that emit alike everywhere."""
        emitted = self.emitted(film)
        return replace(self, logarithm=self.logarithm - emitted + emitted.mean(axis=0))

    def spread(self, residual: F8) -> float:
        """Return the standard deviation of a block; larger if a model (smoothly) leaves more."""
        noise, share = LIGHT_DEVIATION / self.block, residual.shape[1] / MAX_INDEPENDENT_REST
        left = float(np.sqrt(np.square(residual).mean()))
        if self.beneath is not None:
            # The light of a film of known shape measures the LEDs: a model that leaves more errs.
            left = min(left, LIGHT_DEVIATION)
        return float(np.hypot(noise, left * np.sqrt(max(1, share))))


def presses_of(light: F4, slope: F4, mask: U1, height: F4, lit: U1, rows: int) -> list[Press]:
    """Cut the sheets of presses, each of `rows` rows, into single presses."""
    sheets = (light, slope, mask, height, lit)
    return [Press(*parts) for parts in zip(*(cut(sheet, rows) for sheet in sheets), strict=True)]


def samples_for(presses: int) -> float:
    """Number of samples needed per press, for this number of presses."""
    return max(MAX_SAMPLES_EACH, MAX_SAMPLES / presses)


def unreached(objects: list[Object], where: str = "the objects") -> str | None:
    """Return why too few pixels of the objects, here `where`, are lit; None if enough are."""
    reach = np.sum([press.reach for press in objects], axis=0)
    weakest, unlit = int(reach.argmin()), f"pixels of {where} ({MIN_PIXELS} are needed)"
    if reach.max() < MIN_PIXELS:
        return f"LEDs reach only {reach.max()} {unlit}: press deeper, or with a larger ball"
    short = f"LED {weakest + 1} reaches only {reach[weakest]} {unlit}: is it on?"
    return short if reach[weakest] < MIN_PIXELS else None


def is_uniform(flat: Light) -> bool:
    """Return whether the light is the same everywhere: no flat frame was taken."""
    return all(np.ptp(plane) == 0 for plane in flat)
