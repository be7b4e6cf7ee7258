"""Read the height maps of many touches: results of a stream or batch, or a recording's."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval

from tactograph.rings.frames.calibrated_film import calibrated_film
from tactograph.sdk import (
    F4,
    FileKind,
    HeightFile,
    InputError,
    PixelSize,
    Port,
    StoredResult,
    View,
    load,
    node,
    warn,
)
from tactograph.sdk.nodes import read_error, read_pixel_size, read_result_view

TouchHeights = Annotated[F4, Port("P H W", "mm", nan=True)]
"""Heights of P touches; NaN where not known."""
MAX_TOUCHES = 255
NO_PLANE = "its film is no plane at rest; touches of planes alone are put together"


class Touches(NamedTuple):
    """Heights and their standard deviations, NaN where none is stated, and their names."""

    heights: TouchHeights
    errors: TouchHeights
    pixel: PixelSize
    names: list[str]


@node
def read_touches(
    *,
    folder: Path,
    most: Annotated[int, Interval(ge=2, le=MAX_TOUCHES)] = 60,
    pixel_size_mm: PixelSize | None = None,
    calibration: Path | None = None,
) -> Touches:
    """Read heights on an even grid, and their errors where they are stated.

    Heights as a camera sees them, by a lens or from near, are brought on to it.

    Of more than `most` touches, as a stream has, so many are taken, evenly spread.

    Parameters
    ----------
    folder
        Holds one folder per result, as `write_result` leaves them; or is the store of a batch; or,
        with a calibration, holds frames, as `record` writes them.
    most : number of touches; of more, so many are taken, evenly spread
    pixel_size_mm : for stores of graphs that put out no pixel size
    calibration
        Of the sensor whose frames `folder` holds: `replay` makes heights of them, without errors.

    Raises
    ------
    InputError
        If there are less than 2 touches, they differ in size or pixel size, or state none.
    """
    if StoredResult.file_of(folder) is not None:
        raise InputError(f"{folder}: is one result; give the folder that holds those of a stream")
    if calibration is not None:
        return _replayed(folder, most, calibration)
    read = _read_store if (folder / "zarr.json").is_file() else _read_results
    touches = read(folder, most, pixel_size_mm)
    for name, height in zip(touches.names, touches.heights, strict=True):
        HeightFile(height).checked(folder / name, unknown=True)
    return touches


def _spread(count: int, most: int, folder: Path, advice: str) -> list[int]:
    """Which of the touches are taken."""
    if count < 2:
        raise InputError(f"{folder}: holds {count} results, and 2 are needed; {advice}")
    return sorted({*np.linspace(0, count - 1, min(most, count)).round().astype(int)})


def _read_results(folder: Path, most: int, pixel: float | None) -> Touches:
    every = [each for each in sorted(folder.glob("*/")) if StoredResult.file_of(each)]
    advice = (
        "give a folder that 'tactograph run reconstruct' wrote for a stream, or a recording with "
        "its sensor's `calibration`"
    )
    results = [every[n] for n in _spread(len(every), most, folder, advice)]
    files = [result / "height.npy" for result in results]
    heights = [HeightFile.read(file).height for file in files]
    pixels = [read_pixel_size(height=file, mm=pixel) for file in files]
    for result, file in zip(results, files, strict=True):
        stored = StoredResult.beside(file)
        if not stored.about:
            raise InputError(f"{stored.file}: cannot be read; reconstruct again")
        if stored.has_relief:
            raise InputError(f"{result}: {NO_PLANE}")
    for result, height, size in zip(results, heights, pixels, strict=True):
        if height.shape != heights[0].shape or not HeightFile.agree(size, pixels[0]):
            raise InputError(f"{result}: differs in size or pixel size from {results[0]}")
    stated = [read_error(height=file) for file in files]
    errors = [np.full_like(heights[0], np.nan) if e is None else e for e in stated]
    names = [result.name for result in results]
    return _even(
        heights, errors, [read_result_view(height=file) for file in files], pixels[0], names
    )


def _even(
    heights: Sequence[F4], errors: Sequence[F4], views: list[View], pixel: float, names: list[str]
) -> Touches:
    """Touches as their cameras see them, on an even grid on the film."""
    planes = [
        view.on_even_grid(height, [error])
        for height, error, view in zip(heights, errors, views, strict=True)
    ]
    even, deviations = np.stack([p[0] for p in planes]), np.stack([p[1][0] for p in planes])
    return Touches(even, deviations, pixel, names)


def _read_store(folder: Path, most: int, pixel: float | None) -> Touches:
    from tactograph.rings.batch.batch_maps import BatchMaps

    maps = BatchMaps(folder)
    pixel = pixel or maps.pixel
    if "height" not in maps.names or pixel is None:
        lacks = "a pixel size: give `pixel_size_mm`=MM" if "height" in maps.names else "heights"
        raise InputError(f"{folder}: this store lacks {lacks}")
    numbers = _spread(len(maps.captures), most, folder, "run the batch over more captures")
    touches = [maps[number] for number in numbers]
    heights = [touch["height"].astype(np.float32) for touch in touches]
    unknown = np.full(heights[0].shape, np.nan, np.float32)
    errors = [touch.get("error", unknown).astype(np.float32) for touch in touches]
    calibration = maps.arguments.get("calibration")
    view = View() if calibration is None else _calibrated_view(Path(calibration))
    names = [Path(maps.captures[n]).name for n in numbers]
    return _even(heights, errors, [view] * len(heights), pixel, names)


def _replayed(folder: Path, most: int, calibration: Path) -> Touches:
    """Heights of a recording's frames, at most twice `most` at a time; one warning of each kind."""
    graph = "replay_oneshot" if calibrated_film(calibration).one_shot else "replay"
    params = {"recording": str(folder), "calibration": str(calibration), "speed": 0.0}
    if graph == "replay":
        params["refresh"] = "cycle"
    heights, stride, pixel = dict[int, F4](), 1, 0.0
    view = _calibrated_view(calibration)
    warnings_by_kind = dict[str, str]()
    with load(graph, params, outputs=["height", "pixel"]) as pipeline:
        for number, result in enumerate(pipeline.items()):
            for line in result.warnings:
                warnings_by_kind.setdefault(re.sub(r"\d[\d.]*", "", line), line)
            if number % stride == 0:
                apparent, pixel = result["height"].copy(), float(result["pixel"])
                heights[number], _ = view.on_even_grid(apparent, [])
            if len(heights) > 2 * most:
                stride *= 2
                heights = {n: height for n, height in heights.items() if n % stride == 0}
    for line in warnings_by_kind.values():
        warn(line)
    frames = [[*heights][n] for n in _spread(len(heights), most, folder, "record more touches")]
    chosen = np.stack([heights[n] for n in frames])
    return Touches(chosen, np.full_like(chosen, np.nan), pixel, [f"{n:05d}" for n in frames])


def _calibrated_view(calibration: Path) -> View:
    """The view of a sensor's calibration; a film that is no plane is refused."""
    module = FileKind.module_of(calibration)
    if module is None:
        raise InputError(f"{calibration}: is no calibration")
    arrays: dict[str, Any] = module.KIND.read(calibration)[0]
    if np.any(arrays.get("rest", 0)):
        raise InputError(f"{calibration}: {NO_PLANE}")
    return View.stated_in({"camera": 0.0, **arrays}, calibration)
