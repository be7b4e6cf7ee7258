"""Show and record a stream of touches with Rerun: images, labels, surface, error band, times.

Long because all that is shown of a touch goes into one recording.
"""

import importlib
import socket
import time as clock
from pathlib import Path
from typing import Annotated, Any, Literal
from urllib.parse import urlsplit

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray
from scipy.special import ndtri

from tactograph.rings.live.nodes.view._live_picture import (
    LIGHT_NAMES,
    colour_height,
    has_screen,
    scale_top,
)
from tactograph.sdk import (
    F4,
    Arrows,
    Axes,
    ColourMap,
    InputError,
    LabelMap,
    Light,
    Lights,
    Provenance,
    Session,
    Touch,
    View,
    need,
    node,
    warn,
)

VIEWER_PORT = 9876
OPEN_TIMEOUT_S = 5.0
"""Longest time that a viewer may take to open."""
CHECK_EVERY_S = 1.0
"""Time between two checks that the viewer is still open."""
CHECK_TIMEOUT_S = 0.05
FLUSH_TIMEOUT_S = 2.0
"""Longest wait at the end of the stream for a viewer that does not answer."""
AXIS_MM = 2.0
"""Length of the arrows that show the object's frame."""
Viewer = Literal["spawn", "connect", "none"]


@node
def view_rerun(
    touch: Touch,
    *,
    lights: Lights = "leds",
    viewer: Viewer = "spawn",
    url: str = "rerun+http://127.0.0.1:9876/proxy",
    file: Path | None = None,
    file_gb: Annotated[float, Gt(0)] = 4.0,
    rate_hz: Annotated[float, Gt(0)] = 10.0,
    image_step: Annotated[int, Interval(ge=1, le=64)] = 2,
    surface_step: Annotated[int, Interval(ge=1, le=64)] = 4,
    provenance: Provenance,
    session: Session,
) -> None:
    """Send touches to a Rerun viewer, write them to an ``.rrd`` file, or both.

    The surface is in mm, x right, -y up, z towards the camera.  Beside it are the height as an
    image with readable values, a section through the highest point with its 90 % band, the
    LEDs' images, the touch's layers, and over time the milliseconds of every node, the latency
    and the metrics.  Needs ``pip install 'tactograph[rerun]'``.

    Parameters
    ----------
    touch
        As `join_touch` makes it.  Its figures are plotted over time.  Layers are images with
        readable values, arrows over the image of LED 1, or axes that move over the surface.
    lights : "bgr" or "rgb" if the lights are the colours of one picture, which is sent as one
    viewer
        "spawn": open a viewer on this screen, or use the one that is open.  "connect": use the
        one at `url`, here or elsewhere.  "none": only the file.
    url : address of the viewer
    file : an ``.rrd`` file to write; None: no file
    file_gb : approximate largest size of the file; beyond it, nothing more is sent
    rate_hz : most touches per second that are sent
    image_step : factor by which the LEDs' images, labels and numbers of regions are reduced
    surface_step : spacing in px of the rows and columns whose pixels become vertices of the surface

    Raises
    ------
    InputError
        If Rerun is not installed, a viewer cannot be opened, or the file cannot be written.
    """
    at = None if viewer == "none" else url
    stream = session.keep(
        lambda: _Stream(_open(viewer, url, file, lights), at, file, 1e9 * file_gb, 1 / rate_hz)
    )
    now = clock.monotonic()
    if not stream.is_due(now):
        return
    age = now - touch.time if touch.time is not None else None
    stream.begin(age)
    stream.images(touch.image[:, ::image_step, ::image_step], lights)
    stream.surface(touch, surface_step)
    stream.section(touch)
    for name, drawing in touch.drawings.items():
        stream.layer(name, drawing, touch, image_step, lights)
    times = {step["node"]: step["ms"] for step in provenance.nodes if not step["once"]}
    latency_s = touch.latency_s(now)
    if latency_s is not None:
        times["latency"] = 1e3 * latency_s
    stream.figures("times", times)
    stream.figures("metrics", touch.metrics or {})
    stream.log("touch", rerun().TextLog(touch.name))
    stream.note(provenance.warnings)


def rerun() -> Any:
    """The Rerun SDK.

    Raises
    ------
    InputError
        If it is not installed.
    """
    need("rerun", "view_rerun", "rerun")
    return importlib.import_module("rerun")


def _open(viewer: Viewer, url: str, file: Path | None, lights: Lights) -> Any:
    """A recording stream to the requested viewer and file."""
    rr = rerun()
    if viewer == "none" and file is None:
        raise InputError("`viewer`=none needs a file to write, such as `file`=live.rrd")
    stream = rr.RecordingStream("tactograph")
    sinks = []
    if viewer == "spawn":
        _spawn(rr)
    if viewer != "none":
        sinks.append(_viewer_sink(rr, url))
    if file is not None:
        sinks.append(_file_sink(rr, file))
    stream.set_sinks(*sinks, default_blueprint=_layout(lights))
    return stream


def _spawn(rr: Any) -> None:
    if not has_screen():
        raise InputError(
            "view_rerun: there is no screen for a viewer (DISPLAY is not set); "
            "`viewer`=none `file`=live.rrd records, `viewer`=connect shows it elsewhere"
        )
    try:
        rr.spawn(connect=False)
    except RuntimeError as error:
        raise InputError(f"view_rerun: the viewer does not open: {error}") from None


def _viewer_sink(rr: Any, url: str) -> Any:
    """The connection to the viewer; a missing viewer raises an error at once, not seconds later."""
    try:
        _reach(url, OPEN_TIMEOUT_S)
        return rr.GrpcSink(url)
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"view_rerun: no viewer answers at {url}: {reason}") from None
    except (ValueError, RuntimeError) as error:
        raise InputError(f"`url`={url}: {error}") from None


def _reach(url: str, patience_s: float) -> None:
    """Raise an OSError if nothing listens there, a ValueError if `url` is not an address."""
    place = urlsplit(url)
    if place.hostname is None:
        raise ValueError("no address of a viewer, such as rerun+http://127.0.0.1:9876/proxy")
    socket.create_connection((place.hostname, place.port or VIEWER_PORT), patience_s).close()


def _file_sink(rr: Any, file: Path) -> Any:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        return rr.FileSink(str(file))
    except (OSError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{file}: cannot be written: {reason}") from None


def _layout(lights: Lights) -> Any:
    """Surface and section on the left, images in the middle, curves below."""
    rrb = importlib.import_module("rerun.blueprint")
    pictures = [(f"led{k}", f"LED {k}") for k in range(1, 5)]
    if lights != "leds":
        pictures = [("colour", "camera")]
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(
                rrb.Vertical(
                    rrb.Spatial3DView(origin="/film", name="surface / mm"),
                    rrb.Spatial2DView(origin="/section", name="section, 90 % band"),
                    row_shares=[2, 1],
                ),
                rrb.Vertical(
                    rrb.Spatial2DView(origin="/height", name="height / mm"),
                    rrb.Spatial2DView(origin="/shadow", name="in shadow"),
                ),
                rrb.Grid(
                    *(
                        rrb.Spatial2DView(origin=f"/camera/{image}", name=name)
                        for image, name in pictures
                    ),
                    grid_columns=min(len(pictures), 2),
                ),
                column_shares=[2, 1, 1],
            ),
            rrb.Horizontal(
                rrb.TimeSeriesView(origin="/times", name="ms"),
                rrb.TimeSeriesView(origin="/metrics", name="metrics"),
                rrb.TextLogView(origin="/notes", name="warnings"),
            ),
            row_shares=[3, 1],
        ),
        collapse_panels=True,
    )


class _Stream:
    """A Rerun recording, with the state of what is sent only once or at a limited rate."""

    def __init__(
        self, recording: Any, url: str | None, file: Path | None, most_bytes: float, pause: float
    ) -> None:
        self._recording, self._url, self._file = recording, url, file
        self._most_bytes, self._pause = most_bytes, pause
        self._due = 0.0
        self._look_at = clock.monotonic() + CHECK_EVERY_S
        self._touches = 0
        self._shape: tuple[int, ...] = ()
        self._once: set[str] = set()
        self._top = 0.0

    def is_due(self, now: float) -> bool:
        if now < self._due or self._recording is None:
            return False
        self._due = now + self._pause
        if self._url is not None and now >= self._look_at:
            self._look_at = now + CHECK_EVERY_S
            self._look(self._url)
        if self._file is not None and self._file.stat().st_size > self._most_bytes:
            warn(f"{self._file}: is as large as it may be; view_rerun has ended")
            self.close()
            return False
        return True

    def _look(self, url: str) -> None:
        """Warn if the viewer was closed, because Rerun itself does not report it."""
        try:
            _reach(url, CHECK_TIMEOUT_S)
        except OSError:
            self._url = None
            warn(f"view_rerun: the viewer at {url} is gone; the stream goes on without it")

    def log(self, path: str | list[object], *entities: Any, static: bool = False) -> None:
        self._recording.log(path, *entities, static=static)

    def begin(self, age: float | None) -> None:
        """Begin a touch that was exposed `age` seconds ago."""
        self._touches += 1
        self._recording.set_time("touch", sequence=self._touches)
        self._recording.set_time("time", timestamp=clock.time() - (age or 0.0))

    def images(self, image: Light, lights: Lights) -> None:
        rr = rerun()
        planes = np.clip(image * np.float32(255), 0, 255).astype(np.uint8)
        if lights == "leds":
            for k, grey in enumerate(planes, start=1):
                self.log(f"camera/led{k}", rr.Image(grey))
        else:
            self.log("camera/colour", rr.Image(np.moveaxis(planes, 0, -1), color_model=lights))

    def layer(self, name: str, drawing: Any, touch: Touch, step: int, lights: Lights) -> None:
        """A layer, in the way in which its kind is drawn."""
        rr, value = rerun(), touch.layers[name]
        match drawing:
            case ColourMap(colours=colours):
                scale = {"gray": "grayscale"}.get(colours, colours)
                self.log(name, rr.DepthImage(value, meter=1000.0, colormap=scale))
            case LabelMap(leds=True):
                classes = _classes(touch.image.shape[0], lights)
                self._log_once(name, rr.AnnotationContext(classes))
                self.log(name, rr.SegmentationImage(value[::step, ::step]))
            case LabelMap():
                self.log(name, rr.SegmentationImage(value[::step, ::step]))
            case Arrows(begin, way):
                arrows = rr.Arrows2D(origins=(begin + 0.5) / step, vectors=way / step)
                self.log(f"camera/led1/{name}", arrows)
            case Axes(entity) as axes:
                self._object(f"film/{entity}", axes.frame)

    def _log_once(self, path: str, entity: Any) -> None:
        """Log what lasts, at the first touch."""
        if path not in self._once:
            self.log(path, entity, static=True)
            self._once.add(path)

    def surface(self, touch: Touch, step: int) -> None:
        """The film as a mesh; its triangles are sent once, its vertices every time."""
        rr, height = rerun(), touch.height
        self._top = scale_top(height, self._top)
        some = touch.film[::step, ::step]
        if self._shape != some.shape:
            mesh = rr.Mesh3D.from_fields(triangle_indices=View().mesh(0 * some, 1.0).faces)
            self.log("film/surface", mesh, static=True)
            self._shape = some.shape
            self.log("film", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        x, y = touch.places_mm(step)
        # Rerun's space is right-handed; with y downwards ours is not.
        vertices = np.stack([x, -y, some], axis=-1).reshape(-1, 3).astype(np.float32)
        mesh = rr.Mesh3D.from_fields(
            vertex_positions=vertices,
            vertex_colors=colour_height(height[::step, ::step], self._top).reshape(-1, 3),
            vertex_normals=_normals(some, step * touch.pixel),
        )
        self.log("film/surface", mesh)
        depth = rr.DepthImage(
            height, meter=1000.0, colormap="viridis", depth_range=(0.0, self._top)
        )
        self.log("height", depth)

    def _object(self, path: str, frame: NDArray[np.float64]) -> None:
        """An object's frame as arrows along x, y and z; z is up."""
        rr, flip = rerun(), np.array([1, -1, 1])
        axes = rr.Arrows3D(vectors=AXIS_MM * np.diag(flip), colors=255 * np.eye(3, dtype=int))
        self._log_once(path, axes)
        turn = flip[:, None] * frame[:3, :3] * flip
        self.log(path, rr.Transform3D(translation=flip * frame[:3, 3], mat3x3=turn))

    def section(self, touch: Touch) -> None:
        """The row through the highest point, x and height in mm, upwards."""
        rr, height, error = rerun(), touch.height, touch.deviation
        row = int(np.unravel_index(int(height.argmax()), height.shape)[0])
        x = touch.places_mm()[0][row]

        def strip(z: F4) -> F4:
            # Images' y points downwards.
            return np.stack([x, -z], axis=-1).astype(np.float32)

        strips, colours = [strip(height[row])], [(31, 95, 168)]
        if error is not None:
            half = np.float32(ndtri(0.95)) * error[row]
            strips += [strip(height[row] - half), strip(height[row] + half)]
            colours += [(150, 180, 215)] * 2
        self.log("section", rr.LineStrips2D(strips, colors=colours))

    def figures(self, group: str, figures: dict[str, float]) -> None:
        scalars = rerun().Scalars
        for name, value in figures.items():
            self.log([group, name], scalars(float(value)))

    def note(self, lines: list[str]) -> None:
        for line in lines:
            self.log("notes", rerun().TextLog(line, level="WARN"))

    def close(self) -> None:
        recording, self._recording = self._recording, None
        if recording is None:
            return
        try:
            recording.flush(timeout_sec=FLUSH_TIMEOUT_S)
        except RuntimeError as error:
            warn(f"view_rerun: the viewer did not get all touches: {error}")
        recording.disconnect()


def _classes(count: int, lights: Lights) -> list[Any]:
    """Name and colour of every label, for single LEDs or colours and for combinations."""
    rr = rerun()
    classes = [rr.AnnotationInfo(0, "lit", (40, 40, 40))]
    for label in range(1, 1 << count):
        leds = [k for k in range(count) if label >> k & 1]
        names, colours = zip(*LIGHT_NAMES[lights], strict=True)
        name = " and ".join(f"LED {names[k]}" if lights == "leds" else names[k] for k in leds)
        colour = colours[leds[0]] if len(leds) == 1 else "#ffffff"
        classes.append(rr.AnnotationInfo(label, name, tuple(bytes.fromhex(colour[1:]))))
    return classes


def _normals(height: F4, pitch: float) -> F4:
    """Unit normals of the surface, for its shading."""
    q, p = np.gradient(height, pitch) if min(height.shape) > 1 else (0 * height, 0 * height)
    normal = np.stack([-p, q, np.ones_like(p)], axis=-1).reshape(-1, 3)
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True), np.float32)
