"""What the ``result.json`` beside a stored height says of it."""

import json
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np

from tactograph.graph import InputError
from tactograph.graph.disk.atomic_files import atomic_files
from tactograph.graph.errors import missing
from tactograph.nodes import MAX_PIXEL_MM, MIN_PIXEL_MM
from tactograph.nodes.files.height_files import HeightFile, write_ply, write_tiff
from tactograph.nodes.files.layer_files import layer_files, write_layer
from tactograph.nodes.files.result_file import RELIEF_FIGURE, RESULT_FILE, checksum, read_result
from tactograph.nodes.optics.camera_view import View
from tactograph.nodes.stream.touch import Touch


class StoredResult(NamedTuple):
    """A ``result.json`` and its content; empty where there is none that can be read."""

    file: Path
    about: dict[str, Any]

    @classmethod
    def beside(cls, height: Path) -> Self:
        """Return the result in the folder of a height map."""
        return cls(height.parent / RESULT_FILE, read_result(height.parent))

    @staticmethod
    def file_of(place: Path) -> Path | None:
        """Return the ``result.json`` that a place is or, as a folder, holds.

        Raises
        ------
        InputError
            If there is no such place.
        """
        try:
            place.stat()
        except (OSError, ValueError):
            raise InputError(missing(place, "file")) from None
        file = place if place.name == RESULT_FILE else place / RESULT_FILE
        return file if file.is_file() else None

    @staticmethod
    @contextmanager
    def new_files(
        folder: Path, about: dict[str, Any] | None, instead_of: Collection[str] = ()
    ) -> Iterator[Path]:
        """Yield a temporary folder; move its files to `folder` if the block succeeds.

        The last of them is ``result.json``: what is known of the result, its files and a checksum
        of each.  There is none if nothing is known.

        Parameters
        ----------
        instead_of : files of an earlier result, which are removed if this one lacks them
        """
        with atomic_files(folder, last=RESULT_FILE, instead_of=instead_of) as target:
            yield target
            if about is not None:
                checksums = {file.name: checksum(file) for file in sorted(target.iterdir())}
                named = {"files": sorted([*checksums, RESULT_FILE]), "checksums": checksums}
                (target / RESULT_FILE).write_text(json.dumps({**about, **named}, indent=1) + "\n")

    @staticmethod
    def write_touch(
        touch: Touch, folder: Path, *, ply: bool = False, pictures: bool = True
    ) -> None:
        """Write a touch's height and layers, a mesh, and pictures into a folder of new files.

        Files and their names are those of `write_result`.
        """
        np.save(folder / "height.npy", touch.height)
        write_tiff(folder / "height.tiff", touch.height, *touch.view.pixel_sides(touch.pixel))
        for layer in touch.each_layer():
            write_layer(layer, folder)
        if ply:
            write_ply(folder / "height.ply", touch.film, touch.pixel, touch.view)
        if pictures:
            # Loading Matplotlib takes longer than computing a touch.
            from tactograph.nodes.drawing.result_pictures import draw_result

            draw_result(touch, folder)

    @property
    def pixel(self) -> float | None:
        """Return the pixel size in mm; None where none is stated.

        Raises
        ------
        InputError
            If its pixels are not square.
        """
        size = self.about.get("pixel_size_mm")
        if isinstance(size, bool) or not isinstance(size, int | float):
            return None
        match self.about.get("pixel_sides_mm"):
            case [float(width), float(length)] if not HeightFile.agree(width, length):
                raise InputError(
                    f"{self.file}: a pixel is {width:.4g} x {length:.4g} mm, not square; "
                    "let 'write_result' write the grid 'metric'"
                )
        return float(size) if MIN_PIXEL_MM <= size <= MAX_PIXEL_MM else None

    @property
    def has_relief(self) -> bool:
        """Return whether its film is no plane at rest."""
        metrics = self.about.get("metrics")
        return isinstance(metrics, dict) and bool(metrics.get(RELIEF_FIGURE))

    def view(self, height: Path) -> View:
        """Return the view of a height map; a plain one for a file that the result does not name.

        Raises
        ------
        InputError
            If what is stated is no view.
        """
        if height.name in self.about.get("files", []):
            return View.stated_in(self.about, self.file)
        return View()

    @property
    def layers(self) -> dict[str, list[str]]:
        """Return which of its files are of a layer, by the layer's name."""
        named = self.about.get("files")
        return layer_files(named) if isinstance(named, list) else {}

    @property
    def changed(self) -> list[Path]:
        """Return its files that are gone, or are others than it was written with."""
        stated = self.about.get("checksums")
        sums = stated.items() if isinstance(stated, dict) else ()
        files = {self.file.parent / name: sum_ for name, sum_ in sums if name == Path(name).name}
        return [f for f, sum_ in files.items() if not f.is_file() or checksum(f) != sum_]


def refuse_view(height: Path) -> None:
    """Refuse a height map whose pixels do not see the film on an even grid.

    Raises
    ------
    InputError
        If the result in its folder states a lens, or a camera's pupil.
    """
    if StoredResult.beside(height).view(height).lens is not None:
        raise InputError(
            f"{height}: is as its camera sees it, by a lens or from near, not on an even grid; "
            "reconstruct with --set save.grid=metric"
        )
