"""One image file: decode, check, crop, and convert to fractions of full scale."""

import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import cv2
import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from tactograph.graph import InputError, warn
from tactograph.graph.disk.array_files import load_array
from tactograph.graph.errors import missing

MAX_LEDS = 8
"""A label has 8 bits."""
IMAGE_FORMATS = ("PNG", "TIFF", "PPM", "BMP", "JPEG")
MAX_HEIGHT_MM = 1e4
"""Largest absolute value of a height map in mm."""
EXIF_ORIENTATION = 0x0112
TIFF_PHOTOMETRIC = 0x0106
"""TIFF tag that is 0 where white is 0."""
Crop = Annotated[tuple[int, int, int, int], "x0,y0,x1,y1"]
Leds = tuple[Annotated[int, Interval(ge=1)], ...]
Lights = Literal["leds", "bgr", "rgb"]
Channel = Literal["blue", "green", "red"]
CHANNEL_NAMES: tuple[Channel, ...] = ("blue", "green", "red")
MEAN_OF_CHANNELS = (
    "their light is the mean of the three channels; `channel`=red, green or blue takes one"
)
SHALLOW_MODE = re.compile(r"^(1)(?:;|$)|;([124])[IR]*$")
"""Pillow's words for pixels of less than 8 bits."""
PGM_HEAD = re.compile(rb"P[25](?:\s+|#[^\n]*\n)*\d+(?:\s+|#[^\n]*\n)+\d+(?:\s+|#[^\n]*\n)+(\d+)")
"""The head of a PGM, up to the value of white."""


@dataclass(frozen=True)
class ImageFile:
    """An image, or an array (``.npy``), in a file."""

    file: Path
    MAX_PIXELS: ClassVar = 2**25
    """Most pixels of one image: 33 million, as of an 8K camera."""

    def read(self) -> NDArray[Any]:
        """Decode it: H x W, or H x W x 3 in the order blue, green, red; ``.npy`` as it is.

        The pixels are taken as stored in the file.  A truncated or foreign file is refused, never
        partly read.  So is a file whose pixels are ambiguous: with an orientation tag, several
        pages or frames, or transparency, and a TIFF in which 0 is white.

        Raises
        ------
        InputError
            If the file is missing, empty, damaged, not an image, or its pixels are ambiguous.
        """
        file = self.file
        if file.suffix.lower() == ".npy":
            return read_numbers(file)
        try:
            if file.stat().st_size == 0:
                raise InputError(f"{file}: the file is empty")
            with _without_exif_warnings(), Image.open(file, formats=IMAGE_FORMATS) as image:
                _check_plain(image, file)
                plane = np.asarray(image)
                plain = image.mode == "L"
            # Pillow reports damage precisely, but converts some bit depths.
            pixels = plane if plain else cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
        except UnidentifiedImageError:
            raise InputError(f"{file}: not an image, or damaged at its start") from None
        except Image.DecompressionBombError:
            raise InputError(f"{file}: too large for a camera image") from None
        except FileNotFoundError:
            raise InputError(missing(file, "file")) from None
        except IsADirectoryError:
            raise InputError(f"{file}: is a folder; one image is needed here") from None
        except (InputError, MemoryError):
            raise
        except Exception as error:  # a damaged file fails anywhere inside its decoder
            if isinstance(error, OSError) and error.strerror:
                raise InputError(f"{file}: cannot be read: {error.strerror}") from None
            raise InputError(f"{file}: cannot be decoded, the file is damaged: {error}") from None
        if pixels is None:
            raise InputError(f"{file}: cannot be decoded; save it as 8 or 16 bit grey or RGB")
        return _without_alpha(np.asarray(pixels), file)

    def write(self, image: NDArray[Any]) -> None:
        """Write H x W, or H x W x 3 in the order blue, green, red; the suffix says how.

        Raises
        ------
        OSError
            If the file cannot be written; `atomic_files` makes it a `WriteError`.
        """
        # On a full disk `cv2.imwrite` returns False and gives no reason.
        self.file.write_bytes(cv2.imencode(self.file.suffix, image)[1].tobytes())


@contextmanager
def _without_exif_warnings() -> Iterator[None]:
    """Drop Pillow's warnings of damaged metadata; an image without all its pixels is refused."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=UserWarning, module="PIL")
        yield


def _check_plain(image: Image.Image, file: Path) -> None:
    """Refuse an image that could be read in more than one way."""
    width, height = image.size
    if width * height > ImageFile.MAX_PIXELS:
        raise InputError(
            f"{file}: {width} x {height} pixels are too large for a camera image "
            f"(at most {ImageFile.MAX_PIXELS // 10**6} million)"
        )
    if depth := SHALLOW_MODE.search(_raw_mode(image)):
        raise InputError(
            f"{file}: has {depth[1] or depth[2]} bits a pixel; save it with 8 or 16, as the camera "
            "gave them"
        )
    frames = getattr(image, "n_frames", 1)
    if frames > 1:
        raise InputError(f"{file}: holds {frames} pages or frames; save each as a file of its own")
    turned = image.getexif().get(EXIF_ORIENTATION, 1)
    if turned != 1:
        raise InputError(
            f"{file}: its orientation tag ({turned}) asks to turn or mirror it; "
            "save the pixels as the camera saw them, without the tag"
        )
    if image.format == "TIFF" and image.getexif().get(TIFF_PHOTOMETRIC) == 0:
        raise InputError(
            f"{file}: its photometric tag says that 0 is white, as in a negative; "
            "save it with black as 0"
        )
    if image.format == "JPEG":
        warn("JPEG compression costs accuracy; record PNG or TIFF")


def _raw_mode(image: Image.Image) -> str:
    """How a file holds its pixels, in Pillow's words, such as "L;4" for four bits of grey."""
    tiles: Any = getattr(image, "tile", None)
    how = tiles[0][3] if tiles else ""
    return str(how[0] if isinstance(how, tuple) else how)


def _without_alpha(image: NDArray[Any], file: Path) -> NDArray[Any]:
    """The image without its alpha channel, which must be opaque."""
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
    height = read_heights(file)
    check_heights(height, file)
    return height


def read_heights(file: Path) -> NDArray[np.float32]:
    """Read a height map in mm from ``.npy``, whatever heights it holds.

    Raises
    ------
    InputError
        If it is not a two-dimensional array of numbers, or holds a pickle.
    """
    array = read_numbers(file)
    if array.ndim != 2 or array.dtype.kind not in "fiu":
        raise InputError(f"{file}: a height map is one two-dimensional array of numbers")
    with np.errstate(over="ignore"):  # too large for float32: infinite, and refused
        return np.asarray(array, np.float32)


def check_heights(height: NDArray[np.float32], file: Path, *, unknown: bool = False) -> None:
    """Refuse arrays that are no height map in mm; with `unknown` a part may be NaN."""
    if not height.size:
        raise InputError(f"{file}: a height map of shape {height.shape} holds no pixel")
    is_known = np.isfinite(height)
    if not unknown and not is_known.all():
        raise InputError(f"{file}: holds NaN or infinite values; every height must be known here")
    if np.isinf(height).any():
        raise InputError(f"{file}: holds infinite values; write NaN where the film is unknown")
    if not is_known.any():
        raise InputError(f"{file}: holds no height, only NaN; reconstruct it again")
    if np.abs(height[is_known]).max() > MAX_HEIGHT_MM:
        raise InputError(f"{file}: holds a height beyond {MAX_HEIGHT_MM:g} mm; heights are in mm")


def read_numbers(file: Path) -> NDArray[Any]:
    """Return the array of a ``.npy``, or refuse a file that holds none."""
    try:
        return load_array(file)
    except FileNotFoundError:
        raise InputError(missing(file, "file")) from None
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: not a NumPy array of numbers: {error}") from None


def grey(image: NDArray[Any], channel: Channel | None = None) -> NDArray[Any]:
    """Return an image H x W; H x W x 3 if its channels differ and none of them is chosen."""
    if image.ndim == 2:
        if channel is not None:
            warn(f"`channel`={channel}: grey images have one channel, which is taken")
        return image
    colours = image[..., :3] if image.shape[2] >= 3 else image[..., :1]
    if channel is not None or (colours == colours[..., :1]).all():
        at = 0 if channel is None or colours.shape[2] == 1 else CHANNEL_NAMES.index(channel)
        return np.ascontiguousarray(colours[..., at])
    return np.ascontiguousarray(colours)


def white_of(files: Sequence[Path], bits: int | None) -> int | None:
    """Return the value of full scale, by the stated depth or as PGMs say; else None.

    Raises
    ------
    InputError
        If one PGM says another than the first, or than the stated depth.
    """
    whites = [_white_in(file) for file in files]
    for file, white in zip(files, whites, strict=True):
        if bits is not None and white not in (None, 2**bits - 1):
            raise InputError(
                f"{file}: says that white is {white}, but 'bits: {bits}' in capture.yaml says "
                f"{2**bits - 1}"
            )
        if bits is None and white != whites[0]:
            raise InputError(
                f"{file}: says that white is {white}, but {files[0].name} says {whites[0]}"
            )
    return whites[0] if bits is None else 2**bits - 1


def check_white(most: float, white: int, plane: NDArray[Any], name: Path | str) -> None:
    """Refuse an image whose largest value, or whose type, does not fit its white."""
    if plane.dtype.kind == "u" and white > np.iinfo(plane.dtype).max:
        bits = white.bit_length()
        raise InputError(
            f"{name}: is {bits_in(plane)} bit, but 'bits: {bits}' in capture.yaml says {bits}; "
            "remove it, or record 16 bit"
        )
    if most > white:
        raise InputError(f"{name}: has values up to {most}, but white is {white}")


def _white_in(file: Path) -> int | None:
    """The white that a PGM of 16 bits states, if it is not its largest number."""
    if file.suffix.lower() != ".pgm":
        return None
    with file.open("rb") as opened:
        head = PGM_HEAD.match(opened.read(1024))
    white = int(head[1]) if head else 0
    return white if 255 < white < 65535 else None


def channels(
    image: NDArray[Any], file: Path, lights: Lights, leds: Leds | None
) -> list[NDArray[Any]]:
    """Return the channels of an image H x W x 3 as lights, H x W each: all, or those of `leds`."""
    if image.ndim != 3 or image.shape[2] < 3 or _is_grey(image):
        raise InputError(f"{file}: a grey image, but `lights`={lights} needs a colour one")
    order = (0, 1, 2) if lights == "bgr" else (2, 1, 0)
    planes = [image[..., i] for i in order]
    if leds is None:
        return planes
    if max(leds) > 3:
        raise InputError(f"{file}: LEDs {','.join(map(str, leds))}: a colour image has 3 lights")
    return [planes[k - 1] for k in leds]


def _is_grey(image: NDArray[Any]) -> bool:
    """Whether all channels are equal; those of an image without content may be."""
    return bool(np.ptp(image) and (image[..., :3] == image[..., :1]).all())


def check_alike(planes: list[NDArray[Any]], files: list[Path]) -> None:
    """Refuse images that are not 8 or 16 bit grey, or differ in size or depth."""
    first = planes[0]
    for plane, file in zip(planes, files, strict=True):
        if plane.dtype not in (np.uint8, np.uint16):
            raise InputError(f"{file}: {plane.dtype} pixels; 8 or 16 bit grey is needed")
        if plane.ndim != first.ndim:
            coloured, plain = (file, files[0]) if plane.ndim > first.ndim else (files[0], file)
            raise InputError(f"{coloured}: a colour image, but {plain.name} is grey")
        check_size(file, plane.shape[:2], files[0].name, first.shape[:2])
        if plane.dtype != first.dtype:
            raise InputError(
                f"{file}: is {bits_in(plane)} bit, but {files[0].name} is {bits_in(first)} bit"
            )


def cropped(plane: NDArray[Any], crop: Crop | None, file: Path) -> NDArray[Any]:
    """Return the part of an image from x0, y0 to x1, y1 in px; refuse one beyond its border."""
    if crop is None:
        return plane
    x0, y0, x1, y1 = crop
    height, width = plane.shape[:2]
    if not (0 <= x0 < x1 and 0 <= y0 < y1):
        raise InputError(
            f"`crop`={x0},{y0},{x1},{y1}: holds no pixel; give x0,y0,x1,y1 with 0 <= x0 < x1 and "
            "0 <= y0 < y1"
        )
    if not (0 <= x0 < x1 <= width and 0 <= y0 < y1 <= height):
        raise InputError(f"`crop`={x0},{y0},{x1},{y1}: {file} has only {width} x {height} pixels")
    return plane[y0:y1, x0:x1]


def bits_in(plane: NDArray[Any]) -> int:
    """Return the bits of a pixel in memory."""
    return 8 * plane.dtype.itemsize


def size_in_words(*shape: int) -> str:
    """Return the size of images H x W, or K x H x W, in words, width first."""
    *lights, rows, columns = shape
    return "".join(f"{count} lights of " for count in lights) + f"{columns} x {rows} pixels"


def check_size(
    place: object, shape: tuple[int, ...], other: str, due: tuple[int, ...], advice: str = ""
) -> None:
    """Refuse images H x W, or K x H x W, that do not have the size of `other` images."""
    if shape != due:
        sizes = f"is {size_in_words(*shape)}, but {other} is {size_in_words(*due)}"
        raise InputError(f"{place}: {sizes}{advice}")
