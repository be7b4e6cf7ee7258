"""Measure heights from shadows: the paper's equation 1, inverted.

Long because both ends of a ray have to be found, on the device in three launches.
"""

from __future__ import annotations

from typing import Annotated, Any

import cv2
import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from tactograph.graph import Close, SizeLimit, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import (
    F4,
    Diffuse,
    Height,
    Labels,
    Light,
    LightPositions,
    PixelSize,
    ShadowRises,
    Slope,
)
from tactograph.nodes.optics.bilinear import bilinear, mask_at
from tactograph.nodes.optics.near_light import expected_light, light_vectors, lights_around
from tactograph.nodes.optics.rays import Rays, rays_towards

STEP_PX = np.float32(0.5)
"""Step along a ray."""
HALF_LIGHT = np.float32(0.5)
MIN_EXPECTED_LIGHT = np.float32(0.02)
MAX_SLOPE = np.float32(3)
MAX_END_PX = np.float32(1.5)
MIN_EDGE_PX = np.float32(1.2)
NO_EDGE_PX = np.float32(-1e6)
SPAN_PX, LANES_SPAN_PX = 16, 64
"""Pixels of a row that one work-item searches for the ends of shadows, on GPUs and on CPUs."""


@node(
    sizes={"K": SizeLimit(1, 8, "a label has 8 bits")},
    tolerance=Close(1e-5, 1e-5, why="a device rounds square roots differently"),
)
def shadow_constraints(
    light: Light,
    shadow: Labels,
    used: Labels,
    slope: Slope,
    height: Height,
    lights: LightPositions,
    pixel: PixelSize,
    diffuse: Diffuse,
    bounced: Light | None = None,
    rest: Height | None = None,
    *,
    longest_px: Annotated[float, Ge(0)] = 10_000.0,
) -> ShadowRises:
    """Measure how far the edge that casts a shadow rises above the shadow's end.

    A ray starts at every lit pixel whose neighbour towards the LED is dark.  It runs towards
    the LED through the shadow to the first lit pixel, the edge that casts the shadow.  The
    light touches the film at both ends, so their heights differ by the shadow's length times
    the tangent of the light's elevation (C1; the paper's equation 1 predicts the length
    from the height).  The shadow ends where half of the direct light arrives, interpolated between
    pixels.

    Parameters
    ----------
    light
        K x H x W, 1 on the film at rest.  Not converted to that of a matt film, since the normal
        of a coated film where half of the light arrives is not known.
    shadow : H x W, the LEDs that do not light a pixel
    used : H x W, the LEDs that determined its slope; both ends of a ray need two
    slope : 2 x H x W; extrapolates the height from a pixel to the shadow's end
    height : H x W in mm, a rough height; the elevation of a near LED depends on it slightly
    lights : K x 3 in mm; z < 0: from the opposite direction (`lights_in_view`)
    pixel : mm per px
    diffuse : length K, the share of the light at rest that the gel diffuses, also into shadows
    bounced : K x H x W, the light from film to film; None: there is none
    rest
        H x W in mm, the seen height of the film at rest; rises are relative to it.  None: a plane
    longest_px : longest shadow to measure; 0 measures none

    Returns
    -------
    C measurements; C is 0 if nothing casts a shadow.
    """
    is_known, side, width = np.bitwise_count(used) >= 2, np.float32(pixel), height.shape[1]
    direct = (light if bounced is None else light - bounced) - diffuse[:, None, None]

    def measure(k: int, rays: Rays, dark: NDArray[np.bool_]) -> ShadowRises:
        """Return the pixels at both ends of each shadow of an LED, and the rise between them."""
        vectors = light_vectors(lights[k : k + 1], height, pixel)
        matt = np.maximum(expected_light(vectors, slope)[0], MIN_EXPECTED_LIGHT)
        expected = (1 - diffuse[k]) * matt
        end, edge = _march(rays, dark, np.clip(direct[k] / expected, 0, 1), longest_px)
        x, y = rays.at(edge + np.float32(0.25))
        is_lit = mask_at(~dark & is_known, x, y)
        rays, end = rays.only(is_lit), end[is_lit]
        top_column, top_row = np.rint(x[is_lit]), np.rint(y[is_lit])
        row, column = rays.row.astype(np.int32), rays.column.astype(np.int32)
        downhill = slope[0, row, column] * rays.ux + slope[1, row, column] * rays.uy
        to_end = side * end * np.clip(downhill, -MAX_SLOPE, MAX_SLOPE)
        length = (top_column - rays.column) * rays.ux + (top_row - rays.row) * rays.uy - end
        tangent = (lights[k, 2] - (height[row, column] + to_end)) / ((rays.plan - end) * side)
        rise = np.asarray(length * side * tangent + to_end, np.float32)
        top, foot = (top_row * width + top_column).astype(np.int32), row * width + column
        return ShadowRises(top, foot, rise, np.full(rise.size, k + 1, np.uint8))

    measurements = [ShadowRises.none()]
    for k, led in enumerate(lights):
        dark = (shadow >> k & 1).astype(bool)
        rays = _ends(dark, is_known, led / side)
        if rays.row.size:
            measurements.append(measure(k, rays, dark))
    rises = ShadowRises(*map(np.concatenate, zip(*measurements, strict=True)))
    if rest is None:
        return rises
    low = rest.ravel()
    rise = rises.rise - (low[rises.top] - low[rises.foot])
    return rises._replace(rise=np.asarray(rise, np.float32))


def _ends(dark: NDArray[np.bool_], is_known: NDArray[np.bool_], led: F4) -> Rays:
    """Rays from lit pixels of known slope whose neighbour towards the LED (in px) is dark."""
    ring = cv2.dilate(dark.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    row, column = (index.astype(np.float32) for index in np.nonzero(ring & ~dark & is_known))
    rays = rays_towards(led, column, row, dark.shape)
    return rays.only(mask_at(dark, *rays.at(np.float32(1))))


def _march(rays: Rays, dark: NDArray[np.bool_], share: F4, longest: float) -> tuple[F4, F4]:
    """The distances along each ray, in px, of the shadow's end and of the edge that casts it.

    The shadow ends where the film gets less than half of its expected light.  The edge is
    `NO_EDGE_PX` if there is none within the frame and the longest shadow.
    """
    rows, columns = dark.shape
    darkness = dark.astype(np.float32)
    end, edge = np.full(rays.row.size, HALF_LIGHT), np.full(rays.row.size, NO_EDGE_PX)
    going, before, t = np.arange(rays.row.size), bilinear(share, rays.column, rays.row), STEP_PX
    while going.size and t <= longest:
        x, y = rays.only(going).at(t)
        inside = (x >= 0) & (x <= columns - 1) & (y >= 0) & (y <= rows - 1)
        going, x, y, before = going[inside], x[inside], y[inside], before[inside]
        if t - STEP_PX < MAX_END_PX:
            now = bilinear(share, x, y)
            falls = (now < HALF_LIGHT) & (before >= HALF_LIGHT)
            back = STEP_PX * (HALF_LIGHT - now) / np.maximum(before - now, np.float32(1e-6))
            end[going[falls]] = np.clip(t - back, 0, MAX_END_PX)[falls]
            before = now
        lit = (t > MIN_EDGE_PX) & (bilinear(darkness, x, y) < HALF_LIGHT)
        edge[going[lit]] = t
        going, before = going[~lit], before[~lit]
        t += STEP_PX
    return end, edge


@shadow_constraints.opencl()
def _launch(run: Launch) -> None:
    """Measure in spans of rows, then gather in the order of LEDs, rows and columns."""
    lights, height, width = sizes = tuple(run.sizes[symbol] for symbol in "KHW")
    inputs = run.inputs
    span = LANES_SPAN_PX if run.lanes > 1 else SPAN_PX
    spans = height * -(-width // span)
    part, rise = run.scratch(sizes), run.scratch(sizes)
    top, foot = run.scratch(sizes, np.int32), run.scratch(sizes, np.int32)
    counts = run.scratch((lights * spans,), np.int32)
    pixel = float(inputs["pixel"])
    run.kernel(
        "lit_part", run.in_row_lanes(height, width),
        inputs["light"], inputs.get("bounced"),
        *(inputs[name] for name in ("slope", "height", "lights", "diffuse", "shadow")),
        part, *sizes, pixel,
    )  # fmt: skip
    run.kernel(
        "measure", (spans,),
        *(inputs[name] for name in ("shadow", "used", "slope", "height", "lights")), part,
        top, foot, rise, counts, *sizes, span,
        pixel, STEP_PX, run.settings["longest_px"],
    )  # fmt: skip
    ends = np.cumsum(run.download(counts), dtype=np.int32)
    run.set_size("C", int(ends[-1]))
    if not ends[-1]:
        return
    out = [run.outputs[name] for name in ShadowRises._fields]
    run.kernel(
        "gather_spans", counts.shape, top, foot, rise, counts, run.put(ends), inputs.get("rest"),
        *out, *sizes, span,
    )  # fmt: skip


@shadow_constraints.example
def _example(rng: np.random.Generator, **sizes: int) -> dict[str, Any]:
    """Patches of shadow on a rough film; nearly everywhere the slope rests on two LEDs or more."""
    shape = sizes["H"], sizes["W"]
    patches = rng.integers(0, 256, (shape[0] // 4 + 1, shape[1] // 6 + 1), dtype=np.uint8)
    shadow = patches.repeat(4, axis=0).repeat(6, axis=1)[: shape[0], : shape[1]]
    lights = lights_around(rng, sizes["K"])
    lights *= rng.choice([1, 1, -1], (sizes["K"], 1))
    used = np.where(rng.random(shape) < 0.9, 15, 1)
    height = rng.uniform(0, 0.5, shape)
    return {"shadow": shadow, "used": used, "height": height, "lights": lights}
