"""A touch: the values that every graph has, and named layers, which differ from graph to graph.

``layers/NAME.py`` of the core or of a ring declares the kind of layer NAME, a `LayerKind` called
``KIND``.  Nodes that write or show a touch loop over its layers (`Touch.each_layer`).  They
know the ways of drawing a kind, but no layer.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError
from tactograph.graph.rings import bring, brought
from tactograph.graph.show.colours import BIT_COLOURS, label_colour
from tactograph.nodes import F4, F8, U1, Height, HeightError, Light, Metrics, PixelSize
from tactograph.nodes.optics.camera_view import View

RECORDED_AGE_S = 10.0
"""Age above which a touch must come from a recording, whose clock differs."""
VISIBLE_RGB, PREDICTED_RGB = (255, 176, 0), (154, 154, 154)
"""Colours (red, green, blue) of visible arrows, and of predicted ones."""
SUBPIXEL_BITS = 4
"""OpenCV draws in sixteenths of a pixel."""


@dataclass
class LiveState:
    """The counters of a stream: frames, touches, drops, and every fault by name.

    `motion` is the largest change of the light, 1 on the film at rest, from one cycle of the
    LEDs to the next.
    """

    frames: int = 0
    touches: int = 0
    dropped: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    settings: dict[str, Any] = field(default_factory=dict)
    motion: float = 0.0


@dataclass(frozen=True)
class Touch:
    """A touch: the inputs of `join_touch` in its units; None for inputs that the graph lacks."""

    height: Height
    image: Light
    pixel: PixelSize
    name: str = ""
    time: float | None = None
    state: LiveState | None = None
    view: View = field(default_factory=View)
    metrics: Metrics | None = None
    layers: Mapping[str, Any] = field(default_factory=dict)
    rest: Height | None = None

    @property
    def film(self) -> Height:
        """The absolute height of the film, which is the height if the film is a plane at rest."""
        return self.height if self.rest is None else self.height + self.rest

    def places_mm(self, step: int = 1) -> tuple[F8, F8]:
        """Return x and y of the points on the film that every `step`-th row and column see.

        They are in mm, right and down from the first pixel's place on an even grid.
        """
        x, y = self.view.places(self.film, step)
        rows, columns = self.height.shape
        return self.pixel * (x + (columns - 1) / 2), self.pixel * (y + (rows - 1) / 2)

    def each_layer(self) -> "list[Layer]":
        """Return its layers with their kinds, in the order in which its graph names them."""
        kinds = LayerKinds()
        return [Layer(name, kinds[name], value) for name, value in self.layers.items()]

    @property
    def drawings(self) -> "dict[str, ColourMap | LabelMap | Arrows | Axes]":
        """Return how its layers are drawn, by name; those that are not are left out."""
        drawn = {each.name: each.kind.drawn for each in self.each_layer()}
        values = self.layers
        return {n: d(self, values[n]) if callable(d) else d for n, d in drawn.items() if d}

    @property
    def deviation(self) -> HeightError | None:
        """The standard deviation of its height; None if it has none."""
        return next((each.value for each in self.each_layer() if each.kind.is_deviation), None)

    def latency_s(self, now: float) -> float | None:
        """Return the time since the exposure; None if unknown, or a recording's."""
        age_s = RECORDED_AGE_S if self.time is None else now - self.time
        return age_s if 0 <= age_s < RECORDED_AGE_S else None


@dataclass(frozen=True)
class ColourMap:
    """A map H x W in a colour scale; `scale` converts the layer's unit to that of the scale, and
    `logarithmic` is for values that span decades."""

    title: str
    unit: str = ""
    colours: Literal["viridis", "magma", "gray"] = "viridis"
    scale: float = 1.0
    logarithmic: bool = False


@dataclass(frozen=True)
class LabelMap:
    """A label for each pixel, over the image: numbers from 1, or bits per LED if it is of `leds`.

    `title` says what is numbered, such as contacts, or what the LEDs do.
    """

    title: str
    leds: bool = False

    @property
    def colours(self) -> list[str]:
        """The colour of each label: near white for none, a dark one for several LEDs."""
        bits = range(256) if self.leds else (0, *(1 << n % len(BIT_COLOURS) for n in range(255)))
        return [label_colour(each) for each in bits]


@dataclass(frozen=True)
class Arrows:
    """Arrows over the camera's image.

    Parameters
    ----------
    start, shift : M x 2 in px
    visible : M, 1 where an arrow is seen, 0 where it is predicted
    """

    start: F4
    shift: F4
    visible: U1

    def draw(self, picture: NDArray[np.uint8], scale: float) -> None:
        """Draw them into a picture H x W x 3 of 8 bit, red first, `scale` times the image."""
        unit = scale * (1 << SUBPIXEL_BITS)
        for begin, by, visible in zip(self.start, self.shift, self.visible, strict=True):
            start, end = (
                (int(x), int(y))
                for x, y in np.round(
                    ((begin + 0.5) + np.stack([0 * by, by])) * unit - (1 << SUBPIXEL_BITS) / 2
                )
            )
            colour = VISIBLE_RGB if visible else PREDICTED_RGB
            cv2.circle(picture, start, 1 << SUBPIXEL_BITS, colour, -1, cv2.LINE_AA, SUBPIXEL_BITS)
            cv2.arrowedLine(picture, start, end, colour, 1, cv2.LINE_AA, SUBPIXEL_BITS, 0.3)


@dataclass(frozen=True)
class Axes:
    """The axes of an object; when the touch began, it was untilted in the image's middle.

    Parameters
    ----------
    entity : the object's name in a view of the surface
    place : x, y, z in mm from the middle of the first pixel on the film at rest
    turn : turn vector in degrees
    covariance : 6 x 6, of place and turn
    """

    entity: str
    place: F8
    turn: F4
    covariance: F4

    @property
    def frame(self) -> NDArray[np.float64]:
        """4 x 4, in mm from the middle of the first pixel."""
        frame = np.eye(4)
        frame[:3, :3], _ = cv2.Rodrigues(np.radians(self.turn, dtype=np.float64))
        frame[:3, 3] = self.place
        return frame


Drawing = Callable[[Touch, Any], Arrows | Axes]
"""Return what stands over the image, or in a view of the surface, for a layer of a touch."""
Topic = Callable[[Touch, Any], NDArray[Any] | Mapping[str, Any] | Axes | None]
"""Return a layer as a stream carries it, lengths in metres and angles in radians: an image H x W,
the fields of N points (including x, y, z), axes in their own units, or None for nothing."""


@dataclass(frozen=True)
class LayerKind:
    """The kind of a layer: its type, and how it is written and drawn.

    A result folder holds an array of floats as ``NAME.npy`` and one of 8 bits as ``NAME.png``
    (flags as 0 and 255), and no record.

    Parameters
    ----------
    quantity
        The annotation of the layer's port: element type, sizes and unit; or a record of ports.
    drawn : how it is drawn, or a function of touch and layer that says it; None: not at all
    topics : its content in a stream of messages, by topic; None: the map as it is
    state : its numbers by name, a part of the state that policies read in a LeRobot dataset
    follows_film
        Whether a result on a metric grid resamples it, like the height; otherwise it stays on the
        camera's pixels.
    is_deviation : whether it is the height's standard deviation, drawn as a band around sections
    warning : returns a warning about a result with this layer; "": none
    """

    quantity: Any
    drawn: ColourMap | LabelMap | Drawing | None = None
    topics: Mapping[str, Topic | None] = field(default_factory=dict)
    state: Callable[[Any], Mapping[str, float]] | None = None
    follows_film: bool = False
    is_deviation: bool = False
    warning: Callable[[Touch, Any], str] | None = None


class Layer(NamedTuple):
    """A layer of a touch, with its kind."""

    name: str
    kind: LayerKind
    value: Any


class LayerKinds(Mapping[str, LayerKind]):
    """Kinds of layers by name, each imported from ``layers/NAME.py`` when it is first used."""

    def __iter__(self) -> Iterator[str]:
        return iter(brought("layers"))

    def __len__(self) -> int:
        return len(brought("layers"))

    def __getitem__(self, name: str) -> LayerKind:
        module = bring("layers", name)
        if module is None:
            raise InputError.unknown(f"no layer of a touch is called '{name}'", name, self)
        kind = getattr(module, "KIND", None)
        if not isinstance(kind, LayerKind):
            raise InputError(f"layer '{name}': KIND of {module.__name__} is not a LayerKind")
        return kind
