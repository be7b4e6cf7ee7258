"""Read captures: one folder with an image per LED, or a folder of such folders.

Long because images come in many layouts, and every mistake has its own message.
"""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from annotated_types import Interval, Len
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from tactograph.graph import InputError, KeepIntegers, node, warn
from tactograph.graph.disk.strict_yaml import Document, EmptyFileError
from tactograph.graph.errors import missing
from tactograph.nodes import F4, Height, Labels, Light, PixelSize, Slope
from tactograph.nodes.capture.led_files import (
    LIGHTS_ADVICE,
    USUAL_PATTERN,
    colour_frames,
    find_led_files,
    has_led_files,
    images_of,
    is_hidden,
)
from tactograph.nodes.capture.listed_capture import listed_capture
from tactograph.nodes.files.exposure import check_exposed, normalised
from tactograph.nodes.files.image_arrays import check_handed_in
from tactograph.nodes.files.image_files import (
    MEAN_OF_CHANNELS,
    Channel,
    Crop,
    ImageFile,
    Leds,
    Lights,
    channels,
    check_alike,
    check_size,
    check_white,
    cropped,
    grey,
    read_numbers,
    read_truth,
    white_of,
)
from tactograph.nodes.files.sensor_identity import SensorIdentity

UNREAD_SUFFIXES = (".webp", ".gif", ".jp2", ".avif", ".heic", ".dng", ".exr")
VIDEO_SUFFIXES = (".mp4", ".m4v", ".avi", ".mov", ".mkv", ".webm", ".mjpg", ".mjpeg")
CAPTURE_FILE = "capture.yaml"
LIKE_CAPTURE_FILE = ("capture.yml", "Capture.yaml", "capture.yaml.txt")
"""What editors and other systems make of its name."""
TRUE_HEIGHT_FILE = "truth_height_mm.npy"
TRUE_REST_FILE = "rest_height_mm.npy"
TRUE_SLOPE_FILE = "truth_slope.npy"
TRUE_SHADOW_FILE = "truth_shadow.png"


class Capture(NamedTuple):
    """One touch: its images, its folder's name in a stream, and the ground truth if known."""

    image: Light
    name: str = ""
    truth: Height | None = None
    truth_slope: Slope | None = None
    truth_shadow: Labels | None = None
    truth_rest: Height | None = None
    """The true film at rest, where the truth is the height of a film that is no plane."""
    pixel_size: PixelSize | None = None
    """Pixel size in the images' own file (`scan_pixel_size`)."""


Length = Annotated[float, Interval(gt=0, le=1e6)]
Place = Annotated[float, Interval(ge=-1e6, le=1e6)]


class CaptureFile(BaseModel):
    """Entries of the optional ``capture.yaml`` beside the images, or in their parent folder.

    The ball's entries are for calibration (`read_balls`); `sensor` is the sensor's name, `serial`
    its camera's.
    """

    model_config = ConfigDict(extra="forbid", strict=True)
    lights: Lights | None = None
    leds: list[int] | None = None
    bits: Annotated[int, Interval(ge=8, le=16)] | None = None
    sensor: str | None = None
    serial: str | None = None
    ball_radius_mm: Length | None = None
    ball_center_px: Annotated[list[Place], Len(2, 2)] | None = None
    ball_contact_px: Length | None = None

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read ``capture.yaml``, if there is one, and that of the folder of captures around it."""
        around = cls._read_alone(folder.absolute().parent)
        own = cls._read_alone(folder).model_dump(exclude_none=True)
        return around.model_copy(update=own)

    @classmethod
    def _read_alone(cls, folder: Path) -> Self:
        """Read ``capture.yaml``, if there is one."""
        file = folder / CAPTURE_FILE
        if file.exists() and not file.is_file():
            raise InputError(f"{file}: is no plain file; put one there, or remove it")
        if file.is_file():
            try:
                return Document.read(file).checked(cls)
            except EmptyFileError:
                return cls()
        for name in LIKE_CAPTURE_FILE:
            if (folder / name).is_file():
                warn(f"{folder / name}: not read; a file of this kind is called {CAPTURE_FILE}")
        return cls()

    def circle(
        self, center_px: tuple[float, float] | None = None, contact_px: float | None = None
    ) -> tuple[float, float, float]:
        """Return x, y and contact radius in px as the file gives them, or the caller; else NaN."""
        x, y = self.ball_center_px or center_px or (np.nan, np.nan)
        return x, y, self.ball_contact_px or contact_px or np.nan


class Layout(NamedTuple):
    """Layout of the images in a capture folder.

    Parameters
    ----------
    lights
        "leds": one image per LED.  "bgr" or "rgb": one colour image, whose channels are the
        lights in that order.  None: the entry in ``capture.yaml``; else "rgb" for a scan of one
        image, and "leds" for others.
    leds
        Which LEDs to read and in what order, counted from 1.  None: all that exist.
    files
        The images' name without suffix; ``{}`` stands for the LED's number, as in
        ``image{:02}``.  With the default, any one name with numbers is accepted.
    crop : x0, y0, x1, y1 in pixels; x1 and y1 are exclusive
    channel
        Of colour images, one per LED, the channel to read.  None: the mean of all three.
    """

    lights: Lights | None = None
    leds: Leds | None = None
    files: str = USUAL_PATTERN
    crop: Crop | None = None
    channel: Channel | None = None

    def led_files(self, folder: Path, stated: CaptureFile | None = None) -> dict[int, Path]:
        """Return the image of each LED by its number; `stated` is the capture's own file."""
        stated = stated or CaptureFile.read(folder)
        return find_led_files(folder, self.files, self.leds or stated.leds or None)

    def cropped(self, plane: NDArray[Any], file: Path) -> NDArray[Any]:
        """Return the crop's part of an image, or of a map of its size; refuse one beyond it."""
        return cropped(plane, self.crop, file)

    def plane(self, file: Path, bits: int | None = None, usual_bits: int | None = None) -> F4:
        """Read one image file as fractions of full scale, H x W: of colours their mean.

        Without `bits`, `usual_bits` is the depth of values in 16.

        Raises
        ------
        InputError
            If the file is missing, damaged or of another depth, or the crop exceeds it.
        """
        plane = self.cropped(grey(ImageFile(file).read(), self.channel), file)
        if plane.dtype not in (np.uint8, np.uint16):
            raise InputError(f"{file}: {plane.dtype} pixels; 8 or 16 bit is needed")
        stated = bits or (usual_bits if plane.dtype == np.uint16 else None)
        full = white_of([file], stated) or np.iinfo(plane.dtype).max
        check_white(plane.max(), full, plane, file)
        light = np.asarray(plane / np.float32(full), np.float32)
        return light if light.ndim == 2 else np.asarray(light.mean(axis=-1), np.float32)

    def images(self, folder: Path, integers: KeepIntegers = False) -> NDArray[Any]:
        """Read the K images of one folder as K x H x W, fractions of full scale.

        If `integers` allows it and the images use all bits of their type, they remain integers.

        Raises
        ------
        InputError
            As `read_capture`.
        """
        lights = self.lights or "leds"
        is_frame = folder.is_file() and lights != "leds"
        if not is_frame:
            _check_folder(folder)
        stated = CaptureFile.read(folder.parent if is_frame else folder)
        if lights == "leds":
            files = [*self.led_files(folder, stated).values()]
            planes = [grey(ImageFile(file).read(), self.channel) for file in files]
        else:
            file = folder if is_frame else _only_image(folder)
            planes = channels(
                ImageFile(file).read(), file, lights, self.leds or tuple(stated.leds or ()) or None
            )
            files = [file] * len(planes)
        check_alike(planes, files)
        stack = np.stack(
            [self.cropped(plane, file) for plane, file in zip(planes, files, strict=True)]
        )
        white = white_of(files, stated.bits)
        if stack.ndim > 3:
            warn(f"colour images: {MEAN_OF_CHANNELS}")
            return np.asarray(normalised(stack, files, white).mean(axis=-1), np.float32)
        if integers and white in (None, np.iinfo(stack.dtype).max):
            check_exposed(stack, files, white)
            return stack
        return normalised(stack, files, white)

    def presses(self, folder: Path, flat: Path | None) -> list[Capture]:
        """Return the captures of a folder, in order of name, if all are of one size.

        It must not be `flat`, that of the untouched film.
        """
        if flat is not None and os.path.realpath(flat) == os.path.realpath(folder):
            raise InputError(
                f"{flat}: is the folder of the presses; give another as that of the untouched film"
            )
        captures = [*read_capture(folder=folder, **self._asdict())]
        first, due = captures[0].name, captures[0].image.shape
        for each in captures:
            advice = "; presses of one sensor are of one size"
            check_size(folder / each.name, each.image.shape, first, due, advice)
        return captures


@node
def read_capture(
    *,
    folder: Path,
    layout: Layout,
    single: bool = False,
    calibration: Path | None = None,
    another_sensor: bool = False,
    integers: KeepIntegers = False,
) -> Iterator[Capture]:
    """Yield every capture below `folder`, its light as a fraction of full scale.

    Parameters
    ----------
    folder
        Holds ``led1.png`` to ``ledK.png`` (8 or 16 bit; PNG, TIFF, PGM or BMP, or JPEG with a
        warning), or images of another name with numbers, or one colour image; or holds such
        folders, which are then read in order of name, or several colour images whose channels are
        the lights; or is such an image.  Hidden folders and files are ignored.
    single : refuse a folder of captures
    calibration, another_sensor
        A capture whose ``capture.yaml``, or that of its parent folder, names another `sensor` or
        `serial` than this calibration is refused, or accepted with a warning.
    integers : whether images may remain the camera's integers

    Returns
    -------
    Images K x H x W, the folder's name, and a simulator's ground truth in the same folder: height
    in mm (``truth_height_mm.npy``; that of the film at rest, ``rest_height_mm.npy``, may also be
    in the parent folder), slope (``truth_slope.npy``) and shadow labels (``truth_shadow.png``),
    each None if the file is absent; and the pixel size that a scan states.

    Raises
    ------
    InputError
        Naming the folder or file, for anything that is missing, ambiguous, damaged, too dark
        to measure, of a different size or depth than its neighbours, or not grey; for an image
        whose pixels are not plain, see `ImageFile.read`; for a capture of another sensor.
    """
    captures = _captures_at(folder, layout)
    is_capture = captures == [folder]
    if single and not is_capture:
        raise InputError(
            f"{folder}: holds {len(captures)} captures, but one is needed; "
            f"give one of them, such as {captures[0]}"
        )
    for one in captures:
        of = SensorIdentity.stated_in(CaptureFile.read(one).model_dump())
        of.check(one, calibration, another_sensor)
        name = one.stem if one.is_file() else one.name
        yield _read(one, layout, "" if is_capture else name, integers)


read_capture.handed_in(check_handed_in)
read_capture.reads_ahead()


def _captures_at(folder: Path, layout: Layout) -> list[Path]:
    """The folder, if it is a capture; or those in it."""
    if folder.is_file() and _lights(folder, layout) != "leds":
        return [folder]
    _check_folder(folder)
    frames = colour_frames(folder) if _lights(folder, layout) != "leds" else []
    if not frames and _is_capture(folder, layout):
        return [folder]
    folders = (d for d in sorted(folder.iterdir()) if d.is_dir() and not is_hidden(d))
    captures = frames or [d for d in folders if _is_capture(d, layout)]
    if not captures:
        raise InputError(f"{folder}: {_what_is_missing(folder, layout)}")
    return captures


def _check_folder(folder: Path) -> None:
    if folder.is_file():
        is_video = folder.suffix.lower() in VIDEO_SUFFIXES
        what = _of_video(folder) if is_video else "is a file; give the folder that holds the images"
        raise InputError(f"{folder}: {what}")
    if not folder.is_dir():
        raise InputError(missing(folder, "folder"))


def _read(folder: Path, layout: Layout, name: str, integers: KeepIntegers) -> Capture:
    image = layout._replace(lights=_lights(folder, layout)).images(folder, integers)
    return Capture(
        image,
        name,
        _true_height(folder / TRUE_HEIGHT_FILE, layout.crop, image),
        _true_slope(folder / TRUE_SLOPE_FILE, layout.crop, image),
        _true_shadow(folder / TRUE_SHADOW_FILE, layout.crop, image),
        _true_rest(folder, layout.crop, image),
        (listed.pixel_size or None) if (listed := listed_capture(folder)) else None,
    )


def _true_height(file: Path, crop: Crop | None, image: Light) -> Height | None:
    return _fitting(read_truth(file), crop, image, file) if file.is_file() else None


def _true_rest(folder: Path, crop: Crop | None, image: Light) -> Height | None:
    """The film at rest beside a true height, in its folder or the one around it."""
    places = (folder / TRUE_REST_FILE, folder.parent / TRUE_REST_FILE)
    file = next((place for place in places if place.is_file()), None)
    if file is None or not (folder / TRUE_HEIGHT_FILE).is_file():
        return None
    return _true_height(file, crop, image)


def _true_slope(file: Path, crop: Crop | None, image: Light) -> Slope | None:
    if not file.is_file():
        return None
    array = read_numbers(file)
    if array.ndim != 3 or array.shape[0] != 2 or array.dtype.kind not in "fiu":
        raise InputError(f"{file}: slopes are one array of numbers, 2 x height x width")
    if not np.isfinite(array).all():
        raise InputError(f"{file}: holds NaN or infinite values")
    return np.stack([_fitting(np.asarray(p, np.float32), crop, image, file) for p in array])


def _true_shadow(file: Path, crop: Crop | None, image: Light) -> Labels | None:
    if not file.is_file():
        return None
    labels = ImageFile(file).read()
    if labels.ndim != 2 or labels.dtype != np.uint8:
        raise InputError(f"{file}: shadow labels are one 8-bit grey image, a bit per LED")
    return _fitting(labels, crop, image, file)


def _fitting(truth: NDArray[Any], crop: Crop | None, image: Light, file: Path) -> NDArray[Any]:
    """The part of a true map that the images show."""
    part = cropped(truth, crop, file)
    check_size(file, part.shape, "an image", image.shape[1:])
    return np.ascontiguousarray(part)


def _is_capture(folder: Path, layout: Layout) -> bool:
    if _lights(folder, layout) == "leds":
        return has_led_files(folder, layout.files, layout.leds)
    return bool(images_of(folder))


def _lights(folder: Path, layout: Layout) -> Lights:
    """Lights as given, or as the folder states; the one image of a scan is a colour image."""
    order = layout.lights or CaptureFile.read(folder.parent if folder.is_file() else folder).lights
    listed = listed_capture(folder) if order is None else None
    if listed is not None and len(listed.images) == 1:
        return "rgb"
    return order or "leds"


def _only_image(folder: Path) -> Path:
    listed = listed_capture(folder)
    images = listed.images if listed is not None else images_of(folder)
    if len(images) != 1:
        names = ", ".join(f.name for f in images[:4]) or "none"
        raise InputError(f"{folder}: one colour image is needed here, there are: {names}")
    return images[0]


def _what_is_missing(folder: Path, layout: Layout) -> str:
    if layout.lights in ("bgr", "rgb"):
        return "holds no colour image, and no folder inside it does"
    if len(images := images_of(folder)) == 1:
        return (
            f"holds a single image, {images[0].name}; a capture has a file, not a page, per LED: "
            f"led1.png, led2.png and so on. If a colour image holds the lights, {LIGHTS_ADVICE}"
        )
    videos = [file for file in folder.iterdir() if file.suffix.lower() in VIDEO_SUFFIXES]
    if videos and not images:
        return f"holds {videos[0].name}, which {_of_video(videos[0])}"
    unread = sorted(f.name for f in folder.iterdir() if f.suffix.lower() in UNREAD_SUFFIXES)
    if unread and not images:
        return f"holds {unread[0]}, a kind of image that is not read: save it as PNG or TIFF"
    return (
        f"holds no {layout.files.format(1)}.png, and no folder inside it does; a capture has one "
        "image per LED, numbered (`files`=NAME{} for other names)"
    )


def _of_video(file: Path) -> str:
    return (
        f"is a video: 'tactograph run live camera={file} port=none' takes it, and where coloured "
        "LEDs are all lit at once 'tactograph run live_oneshot' and 'tactograph run "
        "calibrate_live_oneshot'; here a folder with one image per LED is needed"
    )
