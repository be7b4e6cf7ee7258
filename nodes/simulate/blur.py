"""Blur the images like a lens that is slightly out of focus."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from annotated_types import Interval

from tactograph.graph import Close, node
from tactograph.nodes import Light
from tactograph.nodes.simulate._gaussian import gaussian, smoothed

if TYPE_CHECKING:
    from tactograph.graph.backends.launch import Launch


@node(neutral="light", tolerance=Close(1e-6, 1e-6, why="sums of many terms"))
def blur(light: Light, *, deviation_px: Annotated[float, Interval(ge=0, le=20)] = 0.0) -> Light:
    """Return the images seen through a lens with a Gaussian point spread.

    Parameters
    ----------
    light
        K x H x W; its border pixels are replicated.
    deviation_px
        Standard deviation of the point spread; 0 is a sharp lens.
    """
    weights = gaussian(deviation_px)
    return smoothed(smoothed(light, weights, 2), weights, 1)


@blur.opencl()
def _launch(run: Launch) -> None:
    size = tuple(run.sizes[symbol] for symbol in "KHW")
    weights = gaussian(run.settings["deviation_px"])
    taps = run.keep(weights.tobytes(), lambda: run.upload(weights))
    half, radius = run.scratch(size), len(weights) // 2
    run.kernel("spread", size, run.inputs["light"], taps, half, *size, radius, 1)
    run.kernel("spread", size, half, taps, run.outputs["blur"], *size, radius, 0)
