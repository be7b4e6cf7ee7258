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
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.codecs import BloscCodec
from zarr.storage import LocalStore

from tactograph.graph.batch.entry import DONE, PENDING, Entry, read_figures
from tactograph.graph.batch.job import Job, identity_of
from tactograph.graph.batch.map_types import (
    AXIS_NAMES,
    MapType,
    add_places,
    axes_of,
    captures_in_one,
    pixel_of,
)
from tactograph.graph.cache.result_origin import Origin
from tactograph.graph.errors import InputError

STORE_FORMAT = 4
MAX_CAPTURES = 10**7
MAX_CHUNK = 4096
MAX_PIXELS = 2**25
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

    `job` is the work on every capture, and no other store has the same `stamp`.
    """

    def __init__(self, group: zarr.Group) -> None:
        self._group = group
        self._open: dict[str, zarr.Array[Any]] = {}
        try:
            about: Any = group.attrs["tactograph"]
            if about["format"] != STORE_FORMAT:
                raise InputError(
                    f"{group.store_path}: format {about['format']}; this reads {STORE_FORMAT}; "
                    "give another --out"
                )
            job = about["job"]
            self.stamp, self.chunk = about["stamp"], int(about["chunk"])
            typed = {"maps": tuple(map(str, job["maps"])), "given": dict(job["given"])}
            files = {str(n): dict(identity) for n, identity in dict(job["files"]).items()}
            self.job = Job(**{**job, **typed, "files": files})
            self.origin = Origin(**about["origin"])
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"{group.store_path}: no store of a batch ({error})") from None
        self._check_arrays()

    @property
    def identity(self) -> dict[str, Any]:
        """The properties that must not change between its parts."""
        return identity_of(self.job, self.origin)

    def _check_arrays(self) -> None:
        """Refuse a store that lacks an array, or describes more than a batch can have."""
        count = len(self)
        for name in ("capture", *_CAPTURE_COLUMNS):
            if len(shape := self._array(name).shape) != 1 or shape[0] < count:
                raise self._damage(f"'{name}' is not of length {count}")
        for name in self._by_capture():
            array = self._array(name)
            pixels = math.prod(array.shape[1:])
            if count > MAX_CAPTURES or array.chunks[0] > MAX_CHUNK or pixels > MAX_PIXELS:
                raise self._damage(f"'{name}' is of shape {array.shape}, chunks {array.chunks}")

    def _by_capture(self) -> list[str]:
        """The arrays whose first axis counts the captures: all but coordinates."""
        axes = {*AXIS_NAMES.values()} - {*self.job.maps}
        return [name for name in self._group.array_keys() if name not in axes]

    def _damage(self, damage: str) -> InputError:
        place = self._group.store_path
        return InputError(f"{place}: is damaged: {damage}; remove it, or give another --out")

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
        return self.statuses_of(slice(None))

    def statuses_of(self, part: slice) -> NDArray[np.uint8]:
        """The statuses of some of the captures."""
        return np.asarray(self._read("status", part), np.uint8)

    def damaged(self) -> list[int]:
        """The captures that are marked done, but are not whole.

        Reads every map; a capture whose checksum does not hold, or a map that cannot be
        decoded, counts as damaged.
        """
        finished = np.flatnonzero(self.statuses == DONE)
        if not self.has_maps:
            return [int(number) for number in finished]
        whole = np.ones(len(self), bool)
        for first in range(0, len(self), self.chunk):
            part = self._chunk_of(first)
            if ((part.start <= finished) & (finished < part.stop)).any():
                whole[part] = self.are_whole(part)
        return [int(number) for number in finished if not whole[number]]

    def are_whole(self, part: slice) -> list[bool]:
        """Return whether captures are read as they were written.

        They are read all at once, which takes as long as one, unless some cannot be decoded.
        """
        try:
            entries = self.read_all(part)
            arrays = {name: self._reaching(name, part.stop) for name in self.job.maps}
            maps = {name: np.asarray(array[part]) for name, array in arrays.items()}
        except _DECODE_ERRORS:
            if part.stop - part.start == 1:
                return [False]
            middle = (part.start + part.stop) // 2
            halves = slice(part.start, middle), slice(middle, part.stop)
            return [is_whole for half in halves for is_whole in self.are_whole(half)]
        for at, entry in enumerate(entries):
            entry.maps = {name: maps[name][at] for name in maps}
        checksums = self._read("checksum", part)
        return [int(c) == e.checksum for c, e in zip(checksums, entries, strict=True)]

    def reopen(self, numbers: Sequence[int]) -> None:
        """Mark captures as pending."""
        with self._refusing():
            for number in numbers:
                self._merge("status", self._chunk_of(number), {number: PENDING})

    def _chunk_of(self, number: int) -> slice:
        """The captures that are written together with one."""
        first = number // self.chunk * self.chunk
        return slice(first, min(first + self.chunk, len(self)))

    @property
    def has_maps(self) -> bool:
        return all(name in self._group for name in self.job.maps)

    def map_types(self) -> dict[str, MapType]:
        """The types of the maps in the store."""
        types, pixel = {}, pixel_of(self._group)
        for name in self.job.maps:
            array = self._reaching(name, 0)
            dims: Any = array.attrs["dims"]
            unit = str(array.attrs["unit"])
            types[name] = MapType(array.shape[1:], str(array.dtype), unit, tuple(dims), pixel)
        return types

    def append(self, captures: Sequence[str]) -> None:
        """Add pending captures at the end."""
        start, stop = len(self), len(self) + len(captures)
        others = [name for name in self._by_capture() if name not in ("capture", "status")]
        with self._refusing():
            # The status comes last: its length counts the captures.
            for name in ("capture", *others, "status"):
                array = self._array(name)
                array.resize((stop, *array.shape[1:]))
                if name == "capture" and captures:
                    array[start:stop] = np.array(captures, object)

    def add_maps(self, types: Mapping[str, MapType]) -> None:
        """Make the arrays for the maps, once their types are known."""
        with self._refusing():
            axes = axes_of(types)
            for name in self.job.maps:
                if name not in self._group:
                    self._add_map(name, types[name], axes[name])

    def _add_map(self, name: str, kind: MapType, axes: Sequence[str]) -> None:
        self._group.create_array(
            name,
            shape=(len(self), *kind.shape),
            dtype=kind.dtype,
            chunks=(captures_in_one(kind, self.chunk), *kind.shape),
            shards=(self.chunk, *kind.shape),
            compressors=BloscCodec(cname="lz4", clevel=1, shuffle="bitshuffle"),
            fill_value=0 if kind.dtype.startswith(("uint", "int")) else float("nan"),
            dimension_names=("capture", *axes),
            # xarray and others know `units`.
            attributes={"unit": kind.unit, "units": kind.unit, "dims": list(kind.dims)},
        )
        for axis, size in zip(axes, kind.shape, strict=True):
            if kind.pixel is not None and axis in AXIS_NAMES.values() and axis not in self._group:
                add_places(self._group, axis, size, kind.pixel)

    def write(self, entries: Mapping[int, Entry]) -> None:
        """Write captures of one chunk.

        Raises InputError if the store cannot be written.
        """
        part = self._chunk_of(min(entries))
        with self._refusing():
            for name in self.job.maps:
                if values := {n: e.maps[name] for n, e in entries.items() if name in e.maps}:
                    self._merge(name, part, values)
            for name, (_, _, cell) in _CAPTURE_COLUMNS.items():
                self._merge(name, part, {n: cell(entry) for n, entry in entries.items()})

    @contextmanager
    def _refusing(self) -> Iterator[None]:
        """Name the store if it cannot be written: a disk is full, or gone."""
        try:
            yield
        except OSError as error:
            reason = error.strerror or error
            raise InputError(
                f"{self._group.store_path}: cannot be written: {reason}; once that is mended the "
                "same command goes on"
            ) from None

    def _merge(self, name: str, part: slice, values: Mapping[int, Any]) -> None:
        """Put values among the present ones of the chunk, and write the chunk at once."""
        array = self._reaching(name, part.stop)
        if len(values) == part.stop - part.start:
            # The whole chunk is replaced.
            array[part] = np.array([values[n] for n in range(part.start, part.stop)], array.dtype)
            return
        block = np.array(self._read(name, part))
        for number, value in values.items():
            block[number - part.start] = value
        array[part] = block

    def _read(self, name: str, part: slice) -> NDArray[Any]:
        """Part of an array; parts that cannot be decoded count as never written."""
        array = self._reaching(name, part.stop)
        try:
            return np.asarray(array[part])
        except _DECODE_ERRORS:
            start, stop, _ = part.indices(array.shape[0])
            if stop - start == 1:
                return np.full((1, *array.shape[1:]), array.fill_value, array.dtype)
        middle = (start + stop) // 2
        parts = [self._read(name, slice(start, middle)), self._read(name, slice(middle, stop))]
        return np.concatenate(parts)

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
        array = self._group.get(name)
        if not isinstance(array, zarr.Array):
            raise self._damage(f"'{name}' is missing")
        # Searching for empty pieces, to leave them out, would cost time.
        self._open[name] = array.with_config({"write_empty_chunks": True})
        return self._open[name]

    def _reaching(self, name: str, stop: int | None) -> zarr.Array[Any]:
        """An array that reaches `stop`, opened again, which takes a millisecond, only if needed."""
        array = self._open.get(name)
        if array is None or stop is None or array.shape[0] < stop:
            return self._array(name)
        return array


def create_store(
    place: str, job: Job, origin: Origin, chunk: int, *, overwrite: bool = False
) -> Store:
    """Make an empty store, of which `chunk` captures are written together.

    Raises InputError if it cannot be written, or something is there: other than a store, or a store
    and `overwrite` is False.
    """
    try:
        group = zarr.create_group(LocalStore(place), zarr_format=3, overwrite=overwrite)
        columns = {name: (dtype, fill) for name, (dtype, fill, _) in _CAPTURE_COLUMNS.items()}
        for name, (dtype, fill) in {"capture": (str, ""), **columns}.items():
            group.create_array(
                name,
                shape=(0,),
                chunks=(chunk,),
                dtype=dtype,
                fill_value=fill,
                dimension_names=("capture",),
            )
        about: dict[str, Any] = {"format": STORE_FORMAT, "stamp": uuid.uuid4().hex, "chunk": chunk}
        about |= {"job": asdict(job), "origin": asdict(origin)}
        group.attrs["tactograph"] = json.loads(json.dumps(about))
    except _OPEN_ERRORS as error:
        raise InputError(f"{place}: cannot be made: {error}") from None
    return Store(group)


def open_store(place: str) -> Store | None:
    """Open a store, or return None if nothing is there.

    Raises InputError if something else is there.
    """
    try:
        # Arrays of version 2 may say that they are pickled, which runs code.
        return Store(zarr.open_group(LocalStore(place), mode="r+", zarr_format=3))
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
