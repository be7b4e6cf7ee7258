"""Blur the images like a lens that is slightly out of focus."""

from typing import Annotated

from annotated_types import Interval

from tactograph.graph import Close, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import Light
from tactograph.nodes.simulate._gaussian import launch_smoothed, smoothed


@node(neutral="light", tolerance=Close(1e-6, 1e-6, why="sums of many terms"))
def blur(light: Light, *, deviation_px: Annotated[float, Interval(ge=0, le=20)] = 0.0) -> Light:
    """Return the images seen through a lens with a Gaussian point spread.

    Parameters
    ----------
    light : K x H x W; its border pixels are replicated
    deviation_px : standard deviation of the point spread; 0 is a sharp lens
    """
    return smoothed(light, deviation_px)


@blur.opencl()
def _launch(run: Launch) -> None:
    size = tuple(run.sizes[symbol] for symbol in "KHW")
    out, deviation_px = run.outputs["blur"], run.settings["deviation_px"]
    launch_smoothed(run, run.inputs["light"], out, size, deviation_px)
