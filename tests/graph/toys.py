"""Nodes for the tests of the engine: small, countable, and some of them broken on purpose."""

import errno
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import pyopencl as cl
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.graph import (
    EVERYTHING,
    EndOfStream,
    InputError,
    KeepIntegers,
    Node,
    NodeCall,
    Port,
    Session,
    SizeLimit,
    SizeRule,
    Wanted,
    node,
    warn,
)
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, Dark, Height, Lens, Light, Metrics

CALLS: list[str] = []
"""The nodes that ran, in order; the fixture `toys` empties it."""


class Touch(NamedTuple):
    image: Light
    name: str = ""
    truth: Height | None = None


class Rest(NamedTuple):
    flat: Light
    dark: Dark


@node
def touches(*, count: int = 3, rows: int = 4, columns: int = 5) -> Iterator[Touch]:
    """A stream: the n-th item is full of n, every second one has a truth."""
    for number in range(1, count + 1):
        CALLS.append(f"touch {number}")
        truth = np.full((rows, columns), number, np.float32) if number % 2 else None
        yield Touch(np.full((3, rows, columns), number, np.float32), f"touch{number}", truth)


@node
def at_rest(*, rows: int = 4, columns: int = 5, level: float = 1.0) -> Rest:
    """A flat field, made once."""
    CALLS.append("at_rest")
    return Rest(
        np.full((3, rows, columns), level, np.float32), np.zeros((rows, columns), np.float32)
    )


WHOLE = np.arange(60, dtype=np.uint8).reshape(3, 4, 5) * np.uint8(4)


@node
def whole_touches(*, integers: KeepIntegers = False) -> Iterator[Touch]:
    """A camera's integers where they are allowed, else fractions."""
    image: Any = WHOLE if integers else WHOLE / np.float32(255)
    yield Touch(image, "touch")


@node
def doubled(image: Light) -> Light:
    """Twice the light, on the host alone."""
    CALLS.append("doubled")
    return image * np.float32(2)


@node
def watched(image: Light, truth: Height | None = None) -> Metrics:
    """Figures of an image."""
    return {"mean": float(image.mean()), "truth": -1.0 if truth is None else float(truth.mean())}


@node(endless=True)
def endless_touches(*, stop_at: int = 3) -> Iterator[Touch]:
    """A stream that Ctrl-C ends, pressed before an item; it closes its camera."""
    number = 0
    try:
        while True:
            number += 1
            if number > stop_at:
                raise KeyboardInterrupt
            yield Touch(np.full((3, 4, 5), number, np.float32), f"touch{number}")
    finally:
        CALLS.append("camera closed")


@node
def pressed_words(image: Light) -> str:
    """A sentence: the third image and later ones show a touch."""
    level = float(image[0, 0, 0])
    return f"{'a touch' if level > 2 else 'nothing'} of {level:.1f}"


@endless_touches.rehearsal
def _rehearsal(**_: int) -> Touch:
    CALLS.append("rehearsal")
    return Touch(np.full((3, 4, 5), 7, np.float32), "rehearsal")


@node
def enough(image: Light, *, number: int = 2) -> None:
    """A sink that wants no further item."""
    CALLS.append(f"enough {image[0, 0, 0]:.0f}")
    if image[0, 0, 0] >= number:
        raise EndOfStream


@node
def shrinking_touches() -> Iterator[Touch]:
    """A stream whose images change their size."""
    for rows in (4, 4, 3):
        yield Touch(np.ones((3, rows, 5), np.float32))


@node
def noticed_touches(*, count: int = 3) -> Iterator[Touch]:
    """A stream whose source warns of every item."""
    for touch in touches.function(count=count):
        warn("a warning of the source")
        yield touch


@node
def byte_touches() -> Iterator[Touch]:
    """A stream whose images are not of the type that is declared."""
    yield Touch(np.full((3, 4, 5), 255, np.uint8))


@node
def summed(image: Light, before: Light | None = None) -> Light:
    """The sum of all lights so far."""
    return image if before is None else image + before


summed.opencl(grid="K H W")


class Glare(NamedTuple):
    image: Light
    glare: Light | None = None


@node
def glared(image: Light) -> Glare:
    """An image, and once more if it is bright."""
    return Glare(image, image if image.mean() >= 2 else None)


@node
def counted(before: int | None = None, image: Light | None = None) -> int:
    """The number of items so far."""
    return (before or 0) + 1


@node
def labelled(image: Light) -> Annotated[NDArray[np.uint8], Port("K H W", "LED bits")]:
    """Unsigned integers of three axes that are no camera's frames."""
    return (image > 0.5).astype(np.uint8)


@node
def bits(labels: Annotated[NDArray[np.uint8], Port("K H W", "LED bits")]) -> Light:
    """Every label's bits as a number."""
    return labels.astype(np.float32)


bits.opencl(grid="K H W")


@node(derived={"h": SizeRule("H", by="rows")})
def strips(image: Light, *, rows: int = 2) -> Annotated[F4, Port("K h W", "1")]:
    """The brightest pixel of each strip of rows; see strips.cl."""
    return np.maximum.reduceat(image, np.arange(0, image.shape[1], rows), axis=1)


strips.opencl(grid="K h W")


class Bright(NamedTuple):
    pixel: Annotated[NDArray[np.int32], Port("C", "pixel number")]
    light: Annotated[F4, Port("C", "1")]


@node
def bright(image: Light, *, above: float = 1.5) -> Bright:
    """The pixels of the first image that are brighter; their number depends on the image."""
    pixels = np.flatnonzero(image[0] > above).astype(np.int32)
    return Bright(pixels, image[0].ravel()[pixels])


@bright.opencl()
def _launch_bright(run: Launch) -> None:
    height, width = run.sizes["H"], run.sizes["W"]
    image = run.inputs["image"]
    pixels = np.flatnonzero(run.download(image)[0] > run.settings["above"])
    run.set_size("C", pixels.size)
    if pixels.size:
        arguments = image, run.outputs["pixel"], run.outputs["light"], run.settings["above"]
        run.kernel("bright", (1,), *arguments, height * width)


class Halves(NamedTuple):
    low: Light
    high: Light


@node
def stray_light(*, level: float = 0.0) -> Annotated[float, Port(unit="1")]:
    """Light that is the same everywhere."""
    return level


@node
def halves(
    image: Light,
    stray: Annotated[float, Port(unit="1")] | None = None,
    *,
    wanted: Wanted = EVERYTHING,
) -> Halves:
    """Half the light, and one and a half of it, and stray light on both."""
    CALLS.extend(name for name in ("low", "high") if name in wanted)
    more = np.float32(stray or 0.0)
    low, high = image * np.float32(0.5) + more, image * np.float32(1.5) + more
    return Halves(low if "low" in wanted else None, high if "high" in wanted else None)


@node
def lower_half(image: Light, *, halve: NodeCall = halves) -> Light:
    """Half the light, by the node that this one calls."""
    return halve(image).low


halves.opencl(grid="K H W")


class _Diary:
    """Something to be closed."""

    def __init__(self) -> None:
        CALLS.append("diary opened")

    def close(self) -> None:
        CALLS.append("diary closed")


@node
def holds_open(image: Light, *, session: Session) -> None:
    """A sink that keeps something open."""
    session.keep(_Diary)
    CALLS.append(f"holds_open {image.mean():g}")


@node
def opens_once(*, session: Session) -> int:
    """Runs once, and keeps something open."""
    session.keep(_Diary)
    CALLS.append("opens_once")
    return 1


@node
def leaned(image: Light, table: Annotated[F4, Port("M", "1")] | None = None) -> Light:
    """The image, and all of a table on top; see leaned.cl."""
    return image if table is None else image + table.sum()


leaned.opencl(grid="K H W")


class Gate:
    """The gate at which `gated` waits for the test."""

    _reached, _open = threading.Event(), threading.Event()

    @classmethod
    def close(cls) -> None:
        cls._reached.clear()
        cls._open.clear()

    @classmethod
    def wait_until_reached(cls) -> None:
        assert cls._reached.wait(10)

    @classmethod
    def open(cls) -> None:
        cls._open.set()

    @classmethod
    def pass_through(cls) -> None:
        cls._reached.set()
        assert cls._open.wait(10)


@node
def gated(image: Light) -> Light:
    """The image, once the gate is open."""
    Gate.pass_through()
    return image


@node
def passed_on(image: Light) -> Light:
    """The same array that came in."""
    return image


@node
def scribbling(image: Light) -> Light:
    """Writes into its input."""
    image[...] = 100
    return image


@node
def scribbled(figures: Metrics) -> Metrics:
    """Writes into figures that other nodes read too."""
    figures["mean"] = 100.0
    return figures


@node
def remembered(figures: Metrics, before: Metrics | None = None) -> Metrics:
    """The figures of the item before."""
    return {"before": -1.0 if before is None else before["mean"], "now": figures["mean"]}


@node
def refilled_touches(*, count: int = 3) -> Iterator[Touch]:
    """A stream out of one buffer; each item is a part of it."""
    buffer = np.empty((4, 4, 5), np.float32)
    for number in range(1, count + 1):
        buffer[...] = number
        yield Touch(buffer[:3])


@node
def struck(image: Light, *, at: float = 2.0) -> Light:
    """The image; the device fails at one of them, and reports it only when it is waited for."""
    return image


@struck.opencl()
def _launch_struck(run: Launch) -> None:
    image = run.inputs["image"]
    fails = run.download(image)[0, 0, 0] == run.settings["at"]
    gate = cl.UserEvent(run.queue.context)
    cl.enqueue_copy(run.queue, run.outputs["struck"].buffer, image.buffer, wait_for=[gate])
    assert run.timer  # of an event behind the gate
    gate.set_status(cl.status_code.OUT_OF_RESOURCES if fails else 0)


@node
def filed(image: Light, *, folder: Path) -> None:
    """A sink that writes a file."""
    folder.mkdir(parents=True)
    np.save(folder / "image.npy", image)


@node
def warns_once(image: Light) -> Light:
    """Warns of the second item alone."""
    if image.mean() == 2:
        warn("two")
    return image


@node
def wavers(image: Light) -> Light:
    """Warns of every other item, in other figures."""
    if image.mean() % 2:
        warn(f"{image.mean():g} parts are dark")
    return image


@node
def cut_touches(*, count: int = 2) -> Iterator[Touch]:
    """A stream whose end is missing."""
    yield from touches(count=count)
    warn("cut short")


class _FullDisk:
    def close(self) -> None:
        warn("the disk is full")


@node
def stored(image: Light, *, session: Session) -> None:
    """A sink that learns late that it failed."""
    session.keep(_FullDisk)


@node
def noted(image: Light) -> None:
    """A sink."""
    CALLS.append(f"noted {image.mean():g}")


@node
def talking(image: Light) -> None:
    """A sink that prints, as those of live graphs do."""
    print(f"a figure: {image.mean():g}")


@node
def noticed(image: Light, *, text: str = "a warning") -> Light:
    """Warns of something."""
    warn(text)
    return image


@node
def failing(image: Light, *, at: float = 0.0) -> Light:
    """Fails as a careless node does."""
    if at in (0, image.mean()):
        raise RuntimeError("a careless node")
    return image


@node
def crowded(image: Light) -> Light:
    """Finds no room on the disk."""
    raise OSError(errno.ENOSPC, "No space left on device", "/tmp/x")


@node
def forbidden(image: Light) -> Light:
    """Fails as a node that may not read a file."""
    raise PermissionError(errno.EACCES, "Permission denied", "/tmp/x")


@node
def refusing(image: Light) -> Light:
    """Refuses the user's data."""
    raise InputError("image.png: too dark")


@node
def forgetful(image: Light) -> Light:
    """Returns nothing."""


@node
def listing(image: Light) -> Light:
    """Returns a list."""
    return image.tolist()


@node
def doubtful(image: Light) -> Light:
    """Returns another element type than it declares."""
    return image.astype(np.float64)


@node
def three_planes(
    planes: Annotated[F4, Port("3 H W", "mm/mm")],
) -> Annotated[F4, Port("3 H W", "mm/mm")]:
    """Three planes in, three out."""
    return planes


@node(sizes={"K": SizeLimit(3, None, "it takes three")})
def many_planes(
    planes: Annotated[F4, Port("K H W", "mm/mm")],
) -> Annotated[F4, Port("K H W", "mm/mm")]:
    """At least three planes."""
    return planes


@node
def camera_lens(*, bend: float = 0.0) -> Lens:
    """A lens with a little distortion, or none."""
    return np.array([bend, 0, 0, 0, 0, 0, 0, 0], np.float32)


@node
def in_metres(height: Annotated[F4, Port("H W", "m")]) -> Annotated[F4, Port("H W", "m")]:
    """Takes metres."""
    return height


@node
def choosy(
    *,
    side: Literal["left", "right"],
    share: Annotated[float, Interval(ge=0, le=0.5)] | None = None,
    corner: tuple[int, int] = (0, 0),
    level: float = 1.0,
    bright: bool = False,
) -> Height:
    """Parameters of every kind."""
    return np.full((2, 2), level, np.float32)


TOYS = tuple(name for name, toy in [*vars().items()] if isinstance(toy, Node))
