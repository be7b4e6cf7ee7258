"""Check that images are fit for a height: exposure, bit depth, no raw mosaic."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError, warn
from tactograph.nodes import FALSE_ALARMS
from tactograph.nodes.files.image_files import bits_in, check_white, size_in_words

MIN_SIDE_PX = 4
"""Smallest number of rows and columns of a capture: one cell of a rough height."""
MIN_LIGHT_SHARE = 0.005
"""Share of full scale that the brightest hundredth of an image must reach..."""
GLINT_SHARE = 0.5
"""Share of full scale of a highlight in an otherwise dark image."""
MIN_COUNTS = 4
"""... and number of converter steps that it must reach, because fewer show no gradation."""
UNUSUAL_DEPTHS = (8, 10, 12)
"""Bits of a camera's values that may be meant where no more of 16 bits are in use."""
MIN_LEVELS = 255
"""Steps from black to white of an image of 8 bits; fewer are reported."""
MAX_SATURATED = 1e-3
"""Share of saturated pixels that raises a warning."""
MIN_PLATEAU_SHARE, PLATEAU_SIDE_SHARE = 0.9, 0.97
"""Share of full scale above which a plateau at the largest value is saturation, and share of that
value above which unsaturated light has at most as many pixels."""
SURE_PARITY_SPREAD = 0.3
"""Spread between neighbours, over the entire block, that no lens resolves: such images are
refused."""
PARITY_BLOCK_PX = 64
"""Side of the middle block in which pixels of even and odd rows and columns are compared."""
MAX_PARITY_SPREAD, PARITY_ERRORS = 0.04, 6.0
"""Spread of their means, relative and in standard errors, that is accepted."""

COMPARED_PIXELS = 16
"""Pixels of a line by which one of a single value is looked for, before all of them are."""
JPEG_SUFFIXES = (".jpg", ".jpeg")
JPEG_BLOCK_PX, COMPARED_BLOCKS = 8, 16
"""Side of the blocks that JPEG compresses separately, and number of blocks to examine."""


def normalised(stack: NDArray[Any], files: list[Path], white: int | None) -> NDArray[np.float32]:
    """The images as fractions of full scale, once `check_exposed` accepts them."""
    check_exposed(stack, files, white)
    return np.asarray(stack / np.float32(white or np.iinfo(stack.dtype).max), np.float32)


def check_exposed(
    stack: NDArray[Any],
    names: Sequence[Path | str],
    white: int | None,
    *,
    how_depth: str = "say 'bits: {bits}' in capture.yaml",
) -> None:
    """Refuse images that are tiny, dark or hold too large values; warn of saturated ones.

    Parameters
    ----------
    stack : K x H x W or K x H x W x 3, unsigned integers, or floats as fractions of full scale
    names : of the K images, for messages
    white : the integers' full scale; None: the largest of their type
    how_depth : advice if only `bits` of the bits, up to `full`, are in use
    """
    if min(stack.shape[1:3]) < MIN_SIDE_PX:
        raise InputError(
            f"{names[0]}: {size_in_words(*stack.shape[1:3])}; a height needs {MIN_SIDE_PX} x "
            f"{MIN_SIDE_PX} or more"
        )
    counts = stack.dtype.kind == "u"
    full = white or int(np.iinfo(stack.dtype).max) if counts else 1
    brightest = [plane.max().item() for plane in stack]
    shallow, is_mosaic = "", False
    depths = [bits for bits in UNUSUAL_DEPTHS if max(brightest) < 2**bits]
    if counts and full > 4095 and depths:
        # Of 12 bits a dim image uses ten; of 8 bits in wider numbers any uses eight.
        depths = depths[:1] if depths[0] == 8 else depths
        shallow = "; ".join(
            f"if it is {bits} bit, {how_depth.format(bits=bits, full=2**bits - 1)}"
            for bits in depths
        )
    for plane, name, most in zip(stack, names, brightest, strict=True):
        if most == 0:
            raise InputError(f"{name}: all black; is the LED on and the lens cap off?")
        check_white(most, full, plane, name)
        _check_bright(plane, full, name, shallow)
        saturated = _saturated(plane, most, full)
        if saturated > MAX_SATURATED:
            at = "" if most == full else f" at {most} of {full}"
            if saturated - _share_alone(plane, most) > MAX_SATURATED:
                warn(f"{name}: {saturated:.1%} of the pixels are saturated{at}; expose shorter")
            else:
                warn(
                    f"{name}: {saturated:.1%} of the pixels stand alone at the brightest value, as "
                    "hot pixels do: let the camera correct them, or cool it"
                )
        is_mosaic = is_mosaic or _check_mosaic(plane, name)
    if shallow and white is None:
        warn(
            f"{names[0]}: {bits_in(stack)} bit, but no value above {2 ** depths[0] - 1}; {shallow}"
        )
    if line := _dead_line(stack[0]):
        warn(
            f"{names[0]}: {line} of one value, unlike its neighbours: dead pixels? Let the camera "
            "correct them, or crop the images (precise is harmed least)"
        )
    if _has_jpeg_blocks(stack[0]):
        if Path(names[0]).suffix.lower() not in JPEG_SUFFIXES:  # of these the reader warns
            warn(
                f"{names[0]}: the light jumps at every eighth pixel, as JPEG leaves it, whatever "
                "the file is called; record PNG or TIFF from the camera on"
            )
    elif counts and full < MIN_LEVELS * (step := _level_step(stack[0])):
        warn(
            f"{names[0]}: only one gray level in {step} occurs, as in images of "
            f"{(full // step + 1).bit_length() - 1} bits; record 8 bits or more"
        )


def _level_step(plane: NDArray[Any]) -> int:
    """The common step between all values; 0 if all are equal, 1 if the image is not coarse."""
    for values in plane[0], plane:  # a single row decides for most images
        step = int(np.gcd.reduce(values - values.min(), axis=None))
        if step == 1:
            break
    return step


def _has_jpeg_blocks(plane: NDArray[Any]) -> bool:
    """Whether light changes most across every eighth line, along rows and along columns.

    Without blocks each of the eight lines is as likely, so the counts are binomial.
    """
    blocks = min(COMPARED_BLOCKS, (min(plane.shape[:2]) - 1) // JPEG_BLOCK_PX)
    if plane.ndim > 2 or blocks < 2:
        return False
    side = blocks * JPEG_BLOCK_PX
    y, x = ((rows - side) // 2 for rows in plane.shape)
    middle = plane[y : y + side + 1, x : x + side + 1].astype(np.float32)
    for part in middle[:side], middle[:, :side].T:
        change = np.abs(np.diff(part, axis=1)).mean(axis=0)
        # In a slope of smooth light, the first or the last line of every block changes most.
        stands_out = (change > np.roll(change, 1)) & (change > np.roll(change, -1))
        lines = change.reshape(blocks, JPEG_BLOCK_PX)
        second = np.sort(lines, axis=1)[:, -2:-1]
        alike = int(((lines > second) & stands_out.reshape(lines.shape)).sum(axis=0).max())
        chances = sum(
            math.comb(blocks, count) * (JPEG_BLOCK_PX - 1) ** (blocks - count)
            for count in range(alike, blocks + 1)
        )
        if chances > FALSE_ALARMS * JPEG_BLOCK_PX ** (blocks - 1):
            return False
    return True


def _saturated(plane: NDArray[Any], most: float, full: float) -> float:
    """The share of the pixels where light was cut off, at full scale or shortly below it.

    Some cameras end before: 12 bits at the top of 16, or video's 235 of 255.
    """
    if most < MIN_PLATEAU_SHARE * full:
        return 0.0
    share = np.count_nonzero(plane == most) / plane.size
    if most == full or share <= MAX_SATURATED:
        return share
    side_share = np.count_nonzero(plane > PLATEAU_SIDE_SHARE * most) / plane.size - share
    return share if 0 < side_share < share else 0.0


def _share_alone(plane: NDArray[Any], most: float) -> float:
    """The share of the pixels that are saturated while their neighbours are not.

    A lens spreads light over neighbouring pixels, so these are hot pixels.
    """
    values = plane if plane.dtype in (np.uint8, np.uint16) else plane.astype(np.float32)
    around = cv2.medianBlur(values, 3)
    alone = (plane == most) & (around < np.float32(MIN_PLATEAU_SHARE * most))
    return np.count_nonzero(alone) / plane.size


def _dead_line(plane: NDArray[Any]) -> str:
    """The rows or columns of one value that differs from most of their neighbours'; "": none."""
    if plane.ndim > 2:
        return ""
    for name, lines in ("row", plane), ("column", plane.T):
        few = np.ascontiguousarray(lines[:, :: max(lines.shape[1] // COMPARED_PIXELS, 1)].T)
        low, high = few.min(axis=0), few.max(axis=0)
        even = np.flatnonzero(low == high)
        if not 0 < 2 * even.size < len(lines):  # none, or nothing that is seen
            continue
        breaks = (np.diff(even) > 1) | (low[even[1:]] != low[even[:-1]])
        for run in np.split(even, np.flatnonzero(breaks) + 1):
            if run[0] == 0 or run[-1] == len(lines) - 1:  # the frame around a view
                continue
            value, beside = low[run[0]], [run[0] - 1, run[-1] + 1]
            lower, upper = np.quantile(few[:, beside], (0.25, 0.75), axis=0)
            stands_out = value < lower.min() or value > upper.max()
            if stands_out and (lines[run] == value).all():
                return f"{name} {run[0]}" if run.size == 1 else f"{name}s {run[0]} to {run[-1]}"
    return ""


def _check_mosaic(plane: NDArray[Any], name: Path | str) -> bool:
    """Refuse a certain mosaic; warn of a possible one and return True."""
    spread = _parity_spread(plane)
    if not spread:
        return False
    mosaic = (
        f"{name}: is it a colour camera's raw mosaic, or of interlaced lines? Even and odd "
        f"pixels differ by {spread:.0%}; give the colour image (`channel`=red takes one), "
        "or whole frames"
    )
    if spread > SURE_PARITY_SPREAD:
        raise InputError(mosaic)
    warn(mosaic)
    return True


def _parity_spread(plane: NDArray[Any]) -> float:
    """The spread of the means of even and odd pixels over their mean; 0: none, or chance."""
    if plane.ndim > 2 or min(plane.shape) < PARITY_BLOCK_PX:
        return 0.0
    y, x = ((side - PARITY_BLOCK_PX) // 2 for side in plane.shape)
    block = plane[y : y + PARITY_BLOCK_PX, x : x + PARITY_BLOCK_PX].astype(np.float32)
    kinds = block.reshape(PARITY_BLOCK_PX // 2, 2, PARITY_BLOCK_PX // 2, 2)
    means, mean = kinds.mean((0, 2)), max(float(block.mean()), 1e-6)
    spread = float(np.ptp(means)) / mean
    if spread <= MAX_PARITY_SPREAD:  # the slow deviation need not be computed
        return 0.0
    error = float(kinds.std((0, 2)).max()) / mean / (PARITY_BLOCK_PX // 2)
    return spread if spread > PARITY_ERRORS * error else 0.0


def _check_bright(plane: NDArray[Any], full: int, name: Path | str, shallow: str) -> None:
    """Refuse dark images, whose noise would give a flat height."""
    counts = MIN_COUNTS if plane.dtype.kind == "u" else 0
    sample, least = plane[::4, ::4], max(MIN_LIGHT_SHARE * full, counts)
    # With two per cent above the limit, the slow percentile need not be computed.
    if np.count_nonzero(sample >= least) > 0.02 * sample.size + 1:
        return
    light = float(np.percentile(sample, 99))
    if light >= least:
        return
    hint = f"{shallow}; else, " if shallow and light > MIN_LIGHT_SHARE * 4095 else ""
    if plane.max() > GLINT_SHARE * full:
        hint = "a few pixels are bright: does a ball mirror (calibrate_lights_mirror)? Else, "
    raise InputError(
        f"{name}: too dark to measure, {light:.4g} of {full}; {hint}is the LED on and the lens cap "
        "off, and the exposure long enough?"
    )
