"""Join the results of a graph into one touch."""

from typing import Annotated, Any, NamedTuple

from tactograph.graph import NamedPorts, Port, node
from tactograph.nodes import Height, Light, Metrics, PixelSize, RestHeight
from tactograph.nodes.height.distort_height import distort_height
from tactograph.nodes.optics.camera_view import View
from tactograph.nodes.stream.touch import LayerKinds, LiveState, Touch


class CapturedFrames(NamedTuple):
    """The frames as captured, their name, and, live, their time and the camera's counters."""

    image: Light
    name: str
    time: Annotated[float, Port(unit="s")] | None = None
    state: LiveState | None = None


Layers = Annotated[Any, NamedPorts(LayerKinds, lambda name: LayerKinds()[name].quantity)]
"""Layers of a touch by name: their types are those that their kinds declare."""


@node
def join_touch(
    height: Height,
    pixel: PixelSize,
    frames: CapturedFrames,
    metrics: Metrics | None = None,
    view: View | None = None,
    rest: RestHeight | None = None,
    **layers: Layers,
) -> Touch:
    """Return a touch for the nodes that write or show it: `write_result`, `preview` and others.

    Parameters
    ----------
    height : H x W in mm
    pixel : mm per px
    frames
        The node that gives the frames (K x H x W, 0 to 1, as captured): `read_capture`,
        `read_camera` or another.
    metrics : figures, those of `measure_contact` and `judge_touch` among them
    view : the calibration, for the lens and the camera's height
    rest : R x C in mm on the even grid, the height of the film at rest; None: a plane
    **layers
        What else is known of it: ``shadow``, ``error`` and others.  A ring brings its own.
    """
    arrays = {name: value for name, value in layers.items() if value is not None}
    origin, view = (frames.name, frames.time, frames.state), view or View()
    low = rest if rest is None or view.lens is None else distort_height(rest, view.lens)
    return Touch(height, frames.image, pixel, *origin, view, metrics, arrays, low)
