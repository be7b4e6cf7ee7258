"""Read captures: one folder with an image per LED, or a folder of such folders."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import cv2
import numpy as np
from annotated_types import Gt, Interval, Len
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError
from pydantic import BaseModel, ConfigDict, ValidationError

from tactograph.graph import InputError, node, warn
from tactograph.graph.files.array_files import load_array
from tactograph.graph.files.strict_yaml import read_yaml
from tactograph.nodes import Height, Labels, Light, Slope

SUFFIXES = (".png", ".tiff", ".tif", ".pgm", ".bmp", ".jpg", ".jpeg")
FORMATS = ("PNG", "TIFF", "PPM", "BMP", "JPEG")
MOST_PIXELS = 2**25
"""Of one image: 33 million, as a camera of 8K has."""
DARKEST = 0.005
"""Share of full scale that the brightest hundredth of an image has to reach..."""
FEWEST_COUNTS = 4
"""... and so many steps of the camera's converter, below which light has no shades."""
HIGHEST = 1e4
"""A height map's largest value in mm, either way."""
ORIENTATION = 0x0112
TRUTH = "truth_height_mm.npy"
TRUE_SLOPE = "truth_slope.npy"
TRUE_SHADOW = "truth_shadow.png"
MOST_LEDS = 8
Crop = tuple[int, int, int, int]
Leds = tuple[Annotated[int, Interval(ge=1)], ...]
Lights = Literal["leds", "bgr", "rgb"]


class Capture(NamedTuple):
    """One touch: the images, its folder's name in a stream, and the truth if it is known."""

    image: Light
    name: str = ""
    truth: Height | None = None
    truth_slope: Slope | None = None
    truth_shadow: Labels | None = None


class CaptureFile(BaseModel):
    """What an optional ``capture.yaml`` beside the images may say.

    The ball is that of a calibration: `read_balls`.
    """

    model_config = ConfigDict(extra="forbid", strict=True)
    lights: Lights | None = None
    leds: list[int] | None = None
    bits: Annotated[int, Interval(ge=8, le=16)] | None = None
    ball_radius_mm: Annotated[float, Gt(0)] | None = None
    ball_center_px: Annotated[list[float], Len(2, 2)] | None = None
    ball_contact_px: Annotated[float, Gt(0)] | None = None


@dataclass(frozen=True)
class Layout:
    """How the images lie in a capture folder."""

    lights: Lights = "leds"
    leds: tuple[int, ...] | None = None
    files: str = "led{}"
    bits: int | None = None
    crop: Crop | None = None


@node
def read_capture(
    *,
    folder: Path,
    lights: Lights | None = None,
    leds: Leds | None = None,
    files: str = "led{}",
    crop: Crop | None = None,
    single: bool = False,
) -> Iterator[Capture]:
    """Yield every capture below `folder`, its light as a fraction of full scale.

    Parameters
    ----------
    folder
        Holds ``led1.png`` to ``ledK.png`` (8 or 16 bit grey; PNG, TIFF, PGM or BMP, or JPEG
        with a warning), or one colour image; or holds such folders, which are then read in
        order of name.  Hidden folders and files do not count.
    lights
        "leds": an image per LED.  "bgr" or "rgb": one colour image, its channels being the
        lights in that order.  None: what ``capture.yaml`` says, else "leds".
    leds
        Which LEDs to read and in what order, counted from 1.  None: all there are.
    files
        The images' name without suffix; ``{}`` stands for the LED's number, as in
        ``image{:02}``.
    crop
        x0, y0, x1, y1 in pixels; x1 and y1 are not part of it.
    single
        Refuse a folder of captures.

    Returns
    -------
    Images K x H x W, the folder's name, and what a simulator wrote beside them: the true
    height in mm (``truth_height_mm.npy``), slope (``truth_slope.npy``) and shadow labels
    (``truth_shadow.png``), each None where the file is absent.

    Raises
    ------
    InputError
        Naming the folder or file, for anything that is missing, there twice, damaged, too
        dark to measure, of another size or depth than its neighbours, or not grey; and for an
        image whose pixels are not plain, see `read_image`.
    """
    layout = Layout(lights or "leds", leds, files, None, crop)
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder")
    if _is_capture(folder, layout, lights):
        yield _read(folder, layout, lights, "")
        return
    folders = (d for d in sorted(folder.iterdir()) if d.is_dir() and not _is_hidden(d))
    inside = [d for d in folders if _is_capture(d, layout, lights)]
    if not inside:
        raise InputError(f"{folder}: {_what_is_missing(layout)}, nor any folder that does")
    if single:
        raise InputError(
            f"{folder}: holds {len(inside)} captures, but one is needed; "
            f"give one of them, such as {inside[0]}"
        )
    for one in inside:
        yield _read(one, layout, lights, one.name)


def read_images(folder: Path, layout: Layout) -> NDArray[np.float32]:
    """Read the K images of one folder as K x H x W, fractions of full scale.

    Raises
    ------
    InputError
        As `read_capture`.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder")
    layout = _with_capture_file(folder, layout)
    if layout.lights == "leds":
        files = _led_files(folder, layout)
        planes = [_grey(read_image(file), file) for file in files]
    else:
        file = _only_image(folder)
        planes = _channels(read_image(file), file, layout)
        files = [file] * len(planes)
    _check_alike(planes, files)
    stack = np.stack(
        [_cropped(plane, layout.crop, file) for plane, file in zip(planes, files, strict=True)]
    )
    return _normalised(stack, files, layout)


def read_image(file: Path) -> NDArray[Any]:
    """Decode one image file: H x W, or H x W x 3 in the order blue, green, red.

    The pixels are taken as they lie in the file.  A cut-off or foreign file is refused, never
    half read; so is a file that leaves open which pixels it means: by an orientation tag,
    several pages or frames, or transparency.

    Raises
    ------
    InputError
        If the file is missing, empty, damaged, not an image, or leaves its pixels open.
    """
    try:
        if file.stat().st_size == 0:
            raise InputError(f"{file}: the file is empty")
        with Image.open(file, formats=FORMATS) as image:
            _check_plain(image, file)
            plane = np.asarray(image)
            plain = image.mode == "L"
        # Pillow tells damage precisely, but does not keep every depth as it is.
        found = plane if plain else cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    except UnidentifiedImageError:
        raise InputError(f"{file}: not an image, or damaged at its start") from None
    except Image.DecompressionBombError:
        raise InputError(f"{file}: too large for a camera image") from None
    except FileNotFoundError:
        raise InputError(f"{file}: there is no such file") from None
    except InputError:
        raise
    except MemoryError:
        raise
    except Exception as error:  # a damaged file fails anywhere inside its decoder
        raise InputError(f"{file}: cannot be decoded, the file is damaged: {error}") from None
    if found is None:
        raise InputError(f"{file}: cannot be decoded; save it as 8 or 16 bit grey or RGB")
    return _without_alpha(np.asarray(found), file)


def _check_plain(image: Image.Image, file: Path) -> None:
    """Refuse what could be read in more than one way."""
    width, height = image.size
    if width * height > MOST_PIXELS:
        raise InputError(
            f"{file}: {width} x {height} pixels are too large for a camera image "
            f"(at most {MOST_PIXELS // 10**6} million)"
        )
    frames = getattr(image, "n_frames", 1)
    if frames > 1:
        raise InputError(f"{file}: holds {frames} pages or frames; save each as a file of its own")
    turned = image.getexif().get(ORIENTATION, 1)
    if turned != 1:
        raise InputError(
            f"{file}: its orientation tag ({turned}) asks to turn or mirror it; "
            "save the pixels as the camera saw them, without the tag"
        )
    if image.format == "JPEG":
        warn(f"{file.parent}: JPEG compression costs accuracy; record PNG or TIFF")


def _without_alpha(image: NDArray[Any], file: Path) -> NDArray[Any]:
    """The image without its alpha channel, which has to be opaque."""
    if image.ndim != 3 or image.shape[2] not in (2, 4):
        return image
    full = np.iinfo(image.dtype).max if image.dtype.kind == "u" else 1
    if (image[..., -1] != full).any():
        raise InputError(f"{file}: is transparent in places; save it without an alpha channel")
    return np.ascontiguousarray(image[..., :-1])


def read_truth(file: Path) -> NDArray[np.float32]:
    """Read a height map in mm from ``.npy``.

    Raises
    ------
    InputError
        If it is not a two-dimensional array of finite numbers, or holds a pickle.
    """
    array = _numbers(file)
    if array.ndim != 2 or array.dtype.kind not in "fiu":
        raise InputError(f"{file}: a height map is one two-dimensional array of numbers")
    if not array.size:
        raise InputError(f"{file}: a height map of shape {array.shape} holds no pixel")
    with np.errstate(over="ignore"):  # what is too large for float32 becomes infinite, and told
        height = np.asarray(array, np.float32)
    if not np.isfinite(height).all():
        raise InputError(f"{file}: holds NaN or infinite values")
    if np.abs(height).max() > HIGHEST:
        raise InputError(f"{file}: holds a height beyond {HIGHEST:g} mm; heights are in mm")
    return height


def _numbers(file: Path) -> NDArray[Any]:
    try:
        return load_array(file)
    except FileNotFoundError:
        raise InputError(f"{file}: there is no such file") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: not a NumPy array of numbers: {error}") from None


def _read(folder: Path, layout: Layout, lights: Lights | None, name: str) -> Capture:
    image = read_images(folder, replace(layout, lights=_lights(folder, lights)))
    return Capture(
        image,
        name,
        _true_height(folder / TRUTH, layout.crop, image),
        _true_slope(folder / TRUE_SLOPE, layout.crop, image),
        _true_shadow(folder / TRUE_SHADOW, layout.crop, image),
    )


def _true_height(file: Path, crop: Crop | None, image: Light) -> Height | None:
    return _fitting(read_truth(file), crop, image, file) if file.is_file() else None


def _true_slope(file: Path, crop: Crop | None, image: Light) -> Slope | None:
    if not file.is_file():
        return None
    array = _numbers(file)
    if array.ndim != 3 or array.shape[0] != 2 or array.dtype.kind not in "fiu":
        raise InputError(f"{file}: slopes are one array of numbers, 2 x height x width")
    if not np.isfinite(array).all():
        raise InputError(f"{file}: holds NaN or infinite values")
    return np.stack([_fitting(np.asarray(p, np.float32), crop, image, file) for p in array])


def _true_shadow(file: Path, crop: Crop | None, image: Light) -> Labels | None:
    if not file.is_file():
        return None
    labels = read_image(file)
    if labels.ndim != 2 or labels.dtype != np.uint8:
        raise InputError(f"{file}: shadow labels are one 8-bit grey image, a bit per LED")
    return _fitting(labels, crop, image, file)


def _fitting(truth: NDArray[Any], crop: Crop | None, image: Light, file: Path) -> NDArray[Any]:
    """The part of a true map that the images show."""
    cropped = _cropped(truth, crop, file)
    if cropped.shape != image.shape[1:]:
        raise InputError(f"{file}: is {_size(cropped)}, but the images are {_size(image[0])}")
    return np.ascontiguousarray(cropped)


def _is_capture(folder: Path, layout: Layout, lights: Lights | None) -> bool:
    if _lights(folder, lights) == "leds":
        numbers = layout.leds or (*range(1, MOST_LEDS + 1),)
        return any(_find(folder, layout.files, k) for k in numbers)
    return bool(_images(folder))


def _lights(folder: Path, lights: Lights | None) -> Lights:
    return lights or _capture_file(folder).lights or "leds"


def _capture_file(folder: Path) -> CaptureFile:
    file = folder / "capture.yaml"
    if not file.is_file():
        return CaptureFile()
    document = read_yaml(file)
    try:
        return CaptureFile.model_validate(document.data)
    except ValidationError as error:
        first = error.errors()[0]
        place = document.place(tuple(first["loc"]))
        raise InputError(f"{place}: {first['msg'].lower()}") from None


def _with_capture_file(folder: Path, layout: Layout) -> Layout:
    said = _capture_file(folder)
    leds = layout.leds or (tuple(said.leds) if said.leds else None)
    return replace(layout, leds=leds, bits=layout.bits or said.bits)


def _find(folder: Path, pattern: str, led: int) -> Path | None:
    try:
        stem = pattern.format(led)
        if stem == pattern:
            raise ValueError
    except (ValueError, IndexError, KeyError, AttributeError):
        raise InputError(f"files={pattern}: write it as led{{}} or image{{:02}}") from None
    candidates = (folder / f"{stem}{suffix}" for suffix in SUFFIXES)
    there = [file for file in candidates if file.is_file()]
    if len(there) > 1:
        names = " and ".join(file.name for file in there)
        raise InputError(f"{folder}: {names} are both there; keep the one that is meant")
    return there[0] if there else None


def _led_files(folder: Path, layout: Layout) -> list[Path]:
    if layout.leds is not None:
        if len(set(layout.leds)) < len(layout.leds):
            raise InputError(f"leds={layout.leds}: an LED is named twice")
        found = {k: _find(folder, layout.files, k) for k in layout.leds}
    else:
        there = {k: _find(folder, layout.files, k) for k in range(1, MOST_LEDS + 1)}
        last = max((k for k, file in there.items() if file), default=0)
        found = {k: there[k] for k in range(1, max(last, 1) + 1)}
    missing = [k for k, file in found.items() if file is None]
    if missing:
        name = layout.files.format(missing[0])
        raise InputError(f"{folder}: the image of LED {missing[0]} is missing ({name}.png)")
    if not 3 <= len(found) <= MOST_LEDS:
        raise InputError(
            f"{folder}: {len(found)} LED images; a slope needs from 3 to {MOST_LEDS} of them"
        )
    return [file for file in found.values() if file is not None]


def _images(folder: Path) -> list[Path]:
    files = (f for f in folder.iterdir() if f.suffix.lower() in SUFFIXES and not _is_hidden(f))
    return sorted(files)


def _is_hidden(path: Path) -> bool:
    """Whether it is no capture's: what a killed writer left (`whole_files`), or a system's."""
    return path.name.startswith(".")


def _only_image(folder: Path) -> Path:
    images = _images(folder)
    if len(images) != 1:
        names = ", ".join(f.name for f in images[:4]) or "none"
        raise InputError(f"{folder}: one colour image is needed here, there are: {names}")
    return images[0]


def _what_is_missing(layout: Layout) -> str:
    if layout.lights != "leds":
        return "holds no colour image"
    return f"holds no {layout.files.format(1)}.png (one image per LED)"


def _grey(image: NDArray[Any], file: Path) -> NDArray[Any]:
    if image.ndim == 2:
        return image
    colours = image[..., :3] if image.shape[2] >= 3 else image[..., :1]
    if (colours == colours[..., :1]).all():
        return np.ascontiguousarray(colours[..., 0])
    raise InputError(
        f"{file}: a colour image, but a grey one per LED is needed; "
        "if its channels are the lights, say lights=bgr"
    )


def _channels(image: NDArray[Any], file: Path, layout: Layout) -> list[NDArray[Any]]:
    if image.ndim != 3 or image.shape[2] < 3:
        raise InputError(f"{file}: a grey image, but lights={layout.lights} needs a colour one")
    order = (0, 1, 2) if layout.lights == "bgr" else (2, 1, 0)
    planes = [image[..., i] for i in order]
    if layout.leds is None:
        return planes
    if max(layout.leds) > 3:
        raise InputError(f"leds={layout.leds}: a colour image has 3 lights")
    return [planes[k - 1] for k in layout.leds]


def _check_alike(planes: list[NDArray[Any]], files: list[Path]) -> None:
    first = planes[0]
    for plane, file in zip(planes, files, strict=True):
        if plane.dtype not in (np.uint8, np.uint16):
            raise InputError(f"{file}: {plane.dtype} pixels; 8 or 16 bit grey is needed")
        if plane.shape != first.shape:
            raise InputError(
                f"{file}: is {_size(plane)}, but {files[0].name} is {_size(first)} pixels"
            )
        if plane.dtype != first.dtype:
            raise InputError(
                f"{file}: is {_bits(plane)} bit, but {files[0].name} is {_bits(first)} bit"
            )


def _cropped(plane: NDArray[Any], crop: Crop | None, file: Path) -> NDArray[Any]:
    if crop is None:
        return plane
    x0, y0, x1, y1 = crop
    height, width = plane.shape
    if not (0 <= x0 < x1 <= width and 0 <= y0 < y1 <= height):
        raise InputError(f"crop={x0},{y0},{x1},{y1}: {file} has only {_size(plane)} pixels")
    return plane[y0:y1, x0:x1]


def _normalised(stack: NDArray[Any], files: list[Path], layout: Layout) -> NDArray[np.float32]:
    full = 2 ** (layout.bits or _bits(stack)) - 1
    for plane, file in zip(stack, files, strict=True):
        brightest = int(plane.max())
        if brightest == 0:
            raise InputError(f"{file}: all black; is the LED on and the lens cap off?")
        if brightest > full:
            raise InputError(f"{file}: has values up to {brightest}, but bits: {layout.bits}")
        _check_bright(plane, full, file)
        saturated = float((plane >= full).mean())
        if saturated > 1e-3:
            warn(f"{file}: {saturated:.1%} of the pixels are saturated; expose shorter")
        if stack.dtype == np.uint16 and layout.bits is None and brightest < 4096:
            warn(f"{file}: 16 bit, but no value above 4095; if it is 12 bit, say 'bits: 12'")
    return np.asarray(stack / np.float32(full), np.float32)


def _check_bright(plane: NDArray[Any], full: int, file: Path) -> None:
    """Refuse darkness and its noise, which would give a flat height."""
    light = float(np.percentile(plane[::4, ::4], 99))
    if light >= max(DARKEST * full, FEWEST_COUNTS):
        return
    hint = "; if it is 12 bit, say 'bits: 12'" if full > 4095 and light > DARKEST * 4095 else ""
    raise InputError(
        f"{file}: too dark to measure, {light:g} of {full}; is the LED on and the lens cap off, "
        f"and the exposure long enough?{hint}"
    )


def _bits(plane: NDArray[Any]) -> int:
    return 8 * plane.dtype.itemsize


def _size(plane: NDArray[Any]) -> str:
    return f"{plane.shape[1]} x {plane.shape[0]}"
