"""The results of a batch in one Zarr (version 3) store.

The arrays' first axis counts the captures.  ``capture`` (its place), ``status``, ``reason``,
``figures`` (JSON), ``warnings`` and ``milliseconds`` say how each went; ``checksum`` is that of its
maps and figures.  Every map that the graph puts out (``height``, ``shadow``, …) is an array of that
name with ``unit`` and ``dims`` among its attributes.  A chunk of captures is one shard, so that one
worker writes it alone, and a few captures can be read without the others.

Dimensions have names, so that xarray opens the store: an image's are ``y`` and ``x``, and where
the graph puts out a pixel size, arrays of these names are its coordinates in mm.
"""

import json
import math
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray
from pydantic import TypeAdapter
from zarr.codecs import BloscCodec
from zarr.storage import LocalStore

from tactograph.rings.batch.entry import DONE, PENDING, Entry, read_figures
from tactograph.rings.batch.job import Job
from tactograph.rings.batch.map_types import AXIS_NAMES, MapType, axes_of
from tactograph.sdk import ImageFile, InputError

STORE_FORMAT = 5
MAX_CAPTURES = 10**7
MAX_CHUNK = 4096
"""Limits on what a store's description can make a reader allocate."""
_CAPTURE_COLUMNS: dict[str, tuple[Any, Any, Callable[[Entry], Any]]] = {
    "reason": (str, "", lambda entry: entry.reason),
    "figures": (str, "", lambda entry: json.dumps(entry.figures)),
    "warnings": (str, "", lambda entry: "\n".join(entry.warnings)),
    "milliseconds": ("float32", np.nan, lambda entry: entry.milliseconds),
    "checksum": ("uint32", 0, lambda entry: entry.checksum),
    "status": ("uint8", PENDING, lambda entry: entry.status),
}
"""What an array by capture holds of an entry: type, fill value, cell.  The status is written last,
so that only whole captures count as done."""
_OPEN_ERRORS = (OSError, ValueError, ImportError, TypeError, AttributeError, OverflowError)
"""Errors of opening a store; the last three are Zarr's, at descriptions that it did not write."""
_DECODE_ERRORS = (ValueError, RuntimeError, TypeError, EOFError, KeyError, IndexError)
"""Errors of the codecs at bytes that they did not write."""


class Store:
    """A batch's store, open for reading and for writing `chunk` captures together.

    `identity` must not change between its parts; `types` are those of its maps.
    """

    def __init__(self, place: str, group: zarr.Group) -> None:
        self.place = place
        self._group = group
        self._open: dict[str, zarr.Array[Any]] = {}
        try:
            about: Any = group.attrs["tactograph"]
            if about["format"] != STORE_FORMAT:
                raise InputError(
                    f"{place}: format {about['format']}; this reads {STORE_FORMAT}; "
                    "give another --out"
                )
            self.graph, self.chunk = str(about["name"]), int(about["chunk"])
            self.identity, self.below = dict(about["identity"]), str(about["below"])
            self.arguments = dict(self.identity["arguments"])
            self.inputs = dict(self.identity["inputs"])
            self.types = TypeAdapter(dict[str, MapType]).validate_python(about["types"])
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"{place}: no store of a batch ({error})") from None
        self._check_arrays()

    def _check_arrays(self) -> None:
        """Refuse a store that lacks an array, or describes more than a batch can have."""
        count = len(self)
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(("capture", *_CAPTURE_COLUMNS), ())
        shapes |= {name: kind.shape for name, kind in self._present.items()}
        for name, shape in shapes.items():
            array = self._array(name)
            fits = array.ndim == 1 + len(shape) and array.shape[1:] == shape
            if not fits or array.shape[0] < count or array.chunks[0] > MAX_CHUNK:
                raise self._damage(f"'{name}' is of shape {array.shape}, chunks {array.chunks}")
            if count > MAX_CAPTURES or math.prod(shape) > ImageFile.MAX_PIXELS:
                raise self._damage(f"'{name}' is of shape {array.shape}")

    @property
    def _present(self) -> dict[str, MapType]:
        """The types of the maps that nobody has removed."""
        return {name: kind for name, kind in self.types.items() if name in self._group}

    def _damage(self, damage: str) -> InputError:
        return InputError(f"{self.place}: is damaged: {damage}; remove it, or give another --out")

    def __len__(self) -> int:
        return int(self._array("status").shape[0])

    @property
    def captures(self) -> list[str]:
        """The captures' places; without them no result could be assigned."""
        try:
            places = [str(word) for word in np.asarray(self._array("capture")[: len(self)])]
        except _DECODE_ERRORS as error:
            raise self._damage(f"'capture' cannot be read: {error}") from None
        if lost := places.count(""):
            raise self._damage(f"'capture' lacks {lost} of {len(places)} names")
        return places

    @property
    def statuses(self) -> NDArray[np.uint8]:
        return np.asarray(self._read("status", slice(len(self))), np.uint8)

    def damaged(self) -> list[int]:
        """The captures that are marked done, but are not whole.

        Reads every map; a capture whose checksum does not hold, or a chunk that cannot be decoded,
        counts as damaged.  Maps that somebody has removed are added again, empty.
        """
        self._add_maps()
        done, damaged = self.statuses == DONE, []
        for part in map(self._chunk_of, range(0, len(self), self.chunk)):
            if done[part].any():
                whole = self.are_whole(part)
                damaged += [
                    n for n in range(part.start, part.stop) if done[n] and not whole[n - part.start]
                ]
        return damaged

    def are_whole(self, part: slice) -> list[bool]:
        """Return whether captures are read as they were written; of one chunk all or none."""
        entries = self.read_all(part)
        try:
            maps = {name: np.asarray(self._array(name)[part]) for name in self.types}
        except _DECODE_ERRORS:
            return [False] * len(entries)
        for at, entry in enumerate(entries):
            entry.maps = {name: maps[name][at] for name in maps}
        checksums = self._read("checksum", part)
        return [int(c) == e.checksum for c, e in zip(checksums, entries, strict=True)]

    def reopen(self, numbers: Sequence[int]) -> None:
        """Mark captures as pending."""
        with self._refusing():
            for number in numbers:
                self._merge("status", {number: PENDING})

    def _chunk_of(self, number: int) -> slice:
        """The captures that are written together with one."""
        first = number // self.chunk * self.chunk
        return slice(first, min(first + self.chunk, len(self)))

    def append(self, captures: Sequence[str]) -> None:
        """Add pending captures at the end."""
        start, stop = len(self), len(self) + len(captures)
        columns = [name for name in _CAPTURE_COLUMNS if name != "status"]
        with self._refusing():
            # The status comes last: its length counts the captures.
            for name in ("capture", *self._present, *columns, "status"):
                array = self._array(name)
                array.resize((stop, *array.shape[1:]))
                if name == "capture" and captures:
                    array[start:stop] = np.array(captures, object)
        self._open.clear()

    def _add_maps(self) -> None:
        """Make the arrays of the maps that are not there."""
        with self._refusing():
            for name, axes in axes_of(self.types).items():
                if name not in self._group:
                    self._add_map(name, self.types[name], axes)

    def _add_map(self, name: str, kind: MapType, axes: Sequence[str]) -> None:
        self._group.create_array(
            name,
            shape=(len(self), *kind.shape),
            dtype=kind.dtype,
            chunks=(kind.in_one_piece(self.chunk), *kind.shape),
            shards=(self.chunk, *kind.shape),
            compressors=BloscCodec(cname="lz4", clevel=1, shuffle="bitshuffle"),
            fill_value=0 if kind.dtype.startswith(("uint", "int")) else float("nan"),
            dimension_names=("capture", *axes),
            # xarray and others know `units`.
            attributes={"unit": kind.unit, "units": kind.unit, "dims": list(kind.dims)},
        )
        for axis, size in zip(axes, kind.shape, strict=True):
            if kind.pixel is not None and axis in AXIS_NAMES.values() and axis not in self._group:
                self._add_places(axis, size, kind.pixel)

    def _add_places(self, axis: str, size: int, pixel: float) -> None:
        """Add the places of an axis' pixels, in mm from the middle of the image."""
        direction = "right" if axis == "x" else "down"
        self._group.create_array(
            axis,
            data=pixel * np.arange(0.5 - size / 2, size / 2),
            dimension_names=(axis,),
            attributes={
                "unit": "mm",
                "units": "mm",
                "long_name": f"{axis} ({direction}, from the middle of the image)",
            },
        )

    def write(self, entries: Mapping[int, Entry]) -> None:
        """Write captures of one chunk.

        Raises InputError if the store cannot be written.
        """
        with self._refusing():
            for name in self.types:
                if values := {n: e.maps[name] for n, e in entries.items() if name in e.maps}:
                    self._merge(name, values)
            for name, (_, _, cell) in _CAPTURE_COLUMNS.items():
                self._merge(name, {n: cell(entry) for n, entry in entries.items()})

    @contextmanager
    def _refusing(self) -> Iterator[None]:
        """Name the store if it cannot be written: a disk is full, or gone."""
        try:
            yield
        except OSError as error:
            raise InputError(
                f"{self.place}: cannot be written: {error.strerror or error}; once that is mended "
                "the same command goes on"
            ) from None

    def _merge(self, name: str, values: Mapping[int, Any]) -> None:
        """Put values of one chunk among its present ones, and write the chunk at once."""
        part, array = self._chunk_of(min(values)), self._array(name)
        if len(values) == part.stop - part.start:
            block = np.array([values[n] for n in range(part.start, part.stop)], array.dtype)
        else:
            block = np.array(self._read(name, part))
            for number, value in values.items():
                block[number - part.start] = value
        array[part] = block

    def _read(self, name: str, part: slice) -> NDArray[Any]:
        """Part of an array; chunks that cannot be decoded count as never written."""
        array = self._array(name)
        try:
            return np.asarray(array[part])
        except _DECODE_ERRORS:
            start, stop, _ = part.indices(array.shape[0])
        cut = self._chunk_of(start).stop
        if stop <= cut:
            return np.full((stop - start, *array.shape[1:]), array.fill_value, array.dtype)
        parts = (slice(start, cut), slice(cut, stop))
        return np.concatenate([self._read(name, each) for each in parts])

    def read_all(self, part: slice = slice(None)) -> list[Entry]:
        """The entries of the captures, without their maps."""
        part = slice(*part.indices(len(self)))
        names = ("status", "reason", "figures", "warnings", "milliseconds")
        columns = [self._read(name, part) for name in names]
        return [
            Entry(int(s), str(r), read_figures(str(f)), str(w).splitlines(), float(ms))
            for s, r, f, w, ms in zip(*columns, strict=True)
        ]

    def map(self, name: str, number: int) -> NDArray[Any]:
        """One map of one capture."""
        return np.asarray(self._array(name)[number])

    def _array(self, name: str) -> zarr.Array[Any]:
        """An array; to open it takes a millisecond, so it stays open."""
        if name not in self._open:
            array = self._group.get(name)
            if not isinstance(array, zarr.Array):
                raise self._damage(f"'{name}' is missing")
            # Searching for empty pieces, to leave them out, would cost time.
            self._open[name] = array.with_config({"write_empty_chunks": True})
        return self._open[name]


def create_store(
    job: Job,
    origin: Mapping[str, Any],
    types: Mapping[str, MapType],
    chunk: int,
    *,
    overwrite: bool = False,
) -> Store:
    """Make an empty store, of which `chunk` captures are written together.

    Raises InputError if it cannot be written, or something is there: other than a store, or a store
    and `overwrite` is False.
    """
    place = Path(job.place)
    there = {*place.glob("*")}
    try:
        group = zarr.create_group(LocalStore(job.place), zarr_format=3, overwrite=overwrite)
        for name, (dtype, fill, _) in {"capture": (str, "", None), **_CAPTURE_COLUMNS}.items():
            group.create_array(
                name,
                shape=(0,),
                chunks=(chunk,),
                dtype=dtype,
                fill_value=fill,
                dimension_names=("capture",),
            )
        about = {
            "format": STORE_FORMAT,
            "name": job.graph.name,
            "graph": job.graph.as_dict(),
            "chunk": chunk,
            "identity": job.identity(origin),
            "below": job.below,
            "types": {name: asdict(kind) for name, kind in types.items()},
        }
        group.attrs["tactograph"] = json.loads(json.dumps(about))
    except _OPEN_ERRORS as error:
        for part in {*place.glob("*")} - there:  # half a store would be taken for a foreign one
            shutil.rmtree(part) if part.is_dir() else part.unlink()
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{job.place}: cannot be made: {reason}") from None
    store = Store(job.place, group)
    store._add_maps()
    return store


def open_store(place: str) -> Store | None:
    """Open a store, or return None if nothing is there.

    Raises InputError if something else is there.
    """
    try:
        # Arrays of version 2 may say that they are pickled, which runs code.
        return Store(place, zarr.open_group(LocalStore(place), mode="r+", zarr_format=3))
    except FileNotFoundError:
        try:
            zarr.open(LocalStore(place), mode="r", zarr_format=2)
        except FileNotFoundError:
            return None
        except _OPEN_ERRORS:
            pass  # a damaged one
        raise InputError(f"{place}: no store of a batch, but of Zarr version 2") from None
    except _OPEN_ERRORS as error:
        raise InputError(f"{place}: no store of a batch: {error}") from None
