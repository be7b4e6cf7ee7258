"""Read the light model that GelSight's software stores with a calibrated sensor."""

from pathlib import Path, PureWindowsPath
from typing import Annotated, NamedTuple

import cv2
import numpy as np
from annotated_types import Interval

from tactograph.rings.metrology.nodes.scan.light_model import MODEL_NUMBERS, LightModel
from tactograph.rings.metrology.nodes.scan.light_model_file import (
    DEGREE_BY_ROWS,
    FlatField,
    Matrix,
    find_light_model,
    read_light_model_file,
)
from tactograph.rings.metrology.nodes.scan.scan_file import is_scan
from tactograph.sdk import F4, Crop, ImageFile, InputError, Layout, Light, PixelSize, node
from tactograph.sdk.nodes import coarsen

TILES_PER_ROW = 3
MIN_FLAT_LIGHT = 1 / 255
"""Darkest light of a flat frame that is divided by."""
MAX_MONOMIALS = 15


class ScanLight(NamedTuple):
    """A sensor's light model, and the size of its pixels."""

    model: LightModel
    pixel_size: PixelSize


@node
def read_light_model(
    *,
    file: Path,
    crop: Crop | None = None,
    cell: Annotated[int, Interval(ge=1, le=64)] = 1,
) -> ScanLight:
    """Read a light model, which holds for the whole frame: a crop moves its positions and gains.

    Parameters
    ----------
    file
        The light model (``.yaml``), with its flat frames beside it; or a scan, whose ``calib``
        names a model in its folder or the one above.
    crop : x0, y0, x1, y1 in pixels, as the images are cropped
    cell : side in pixels of the cells that images are coarsened to; positions and size are theirs

    Raises
    ------
    InputError
        If a file is missing, is no light model, or is damaged.
    """
    file = find_light_model(file) if is_scan(file) else file
    stored = read_light_model_file(file)
    size = stored.width, stored.height
    x0, y0, x1, y1 = crop or (0, 0, *size)
    frame = np.broadcast_to(np.uint8(0), size[::-1])
    Layout(crop=crop).cropped(frame, file)  # refuses a crop beyond the frame
    u, v = (np.arange(count, dtype=np.float32) + (1 - count) / 2 for count in size)
    short = np.float32(min(size))
    degree = max(DEGREE_BY_ROWS[matrix.rows] for matrix in (stored.linear, stored.quadratic))
    gain = None if stored.flat is None else _gain(stored.flat, file, size)
    model = LightModel(
        _by_term(stored.quadratic, stored.leds, MODEL_NUMBERS),
        _by_term(stored.linear, stored.leds, 4)[:, :3],
        u[x0:x1] / short,
        v[y0:y1] / short,
        float(degree),
        np.array(stored.black or stored.leds * [0], np.float32),
        None if gain is None else np.ascontiguousarray(gain[:, y0:y1, x0:x1]),
    )
    return ScanLight(model if cell == 1 else on_cells(model, cell), cell * stored.pixel_size)


def on_cells(model: LightModel, factor: int) -> LightModel:
    """The model for the means of cells of ``factor`` by ``factor`` pixels, as `coarsen` makes."""
    u, v = (
        each[::factor] + (factor - 1) / 2 * np.diff(each[:2]).sum() for each in (model.u, model.v)
    )
    gain = None if model.gain is None else coarsen(model.gain, factor=factor)
    return model._replace(u=u, v=v, gain=gain)


def check_frame(image: Light, model: LightModel, of: str) -> None:
    """Refuse images, named `of`, that are not of the model's frame.

    Raises
    ------
    InputError
        If there are other LEDs, or pixels.
    """
    size = len(model.linear), len(model.v), len(model.u)
    if image.shape != size:
        raise InputError(
            f"the light model describes {size[0]} lights of {size[2]} x {size[1]} pixels, but "
            f"{of} has {len(image)} lights of {image.shape[2]} x {image.shape[1]} pixels"
        )


def _by_term(stored: Matrix, leds: int, terms: int) -> F4:
    """K x terms x 15 from the file's rows, whose highest degree comes first.

    A last term that the file lacks scales the others by 1.
    """
    matrix, degree = np.reshape(stored.values, (stored.rows, -1)), DEGREE_BY_ROWS[stored.rows]
    falling = np.repeat(np.arange(degree, -1, -1), np.arange(degree + 1, 0, -1))
    ascending = np.argsort(falling, kind="stable")
    by_term = np.zeros((leds, terms, MAX_MONOMIALS), np.float32)
    term_count = stored.cols // leds
    by_term[:, :term_count, : stored.rows] = matrix[ascending].T.reshape(leds, term_count, -1)
    if term_count < terms:
        by_term[:, -1, 0] = 1
    return by_term


def _gain(flat: FlatField, file: Path, size: tuple[int, int]) -> F4:
    """K x H x W: what brings each LED's flat frame to its scale."""
    image = file.parent / PureWindowsPath(flat.image).name
    sheet = ImageFile(image).read()
    if sheet.ndim != 2:
        raise InputError(f"{image}: flat frames are one grey image, three tiles a row")
    across, down = TILES_PER_ROW, -(-len(flat.scale) // TILES_PER_ROW)
    if sheet.shape[0] % down or sheet.shape[1] % across:
        raise InputError(
            f"{image}: is {sheet.shape[1]} x {sheet.shape[0]} px, which are not "
            f"{across} x {down} tiles of one size"
        )
    height, width = sheet.shape[0] // down, sheet.shape[1] // across
    light = sheet.astype(np.float32) / np.float32(np.iinfo(sheet.dtype).max)
    tiles = np.maximum(light, np.float32(MIN_FLAT_LIGHT)).reshape(down, height, across, width)
    gains = [
        cv2.resize(scale / tiles[k // across, :, k % across], size, interpolation=cv2.INTER_CUBIC)
        for k, scale in enumerate(np.array(flat.scale, np.float32))
    ]
    return np.stack(gains)
