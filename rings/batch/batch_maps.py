"""The maps of a batch, one capture after another: what a training loop reads."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tactograph.rings.batch.entry import DONE
from tactograph.sdk import InputError, need

if TYPE_CHECKING:
    from tactograph.rings.batch.store import Store


class BatchMaps:
    """The finished captures of a store, a mapping of maps each.

    It is a map-style dataset of PyTorch, which needs ``len`` and an index.  Every process opens the
    store for itself, so that workers may be forked or spawned.

    Parameters
    ----------
    place
        A folder, the ``--out`` of `tactograph batch`.
    *names
        The maps that are wanted; all, if none is named.

    Attributes
    ----------
    names
        The names of the maps.
    captures
        The place of each capture.
    arguments
        The values that the batch gave its graph.
    pixel
        The pixel size in mm; None if the graph puts out none.

    Raises
    ------
    InputError
        If there is no such store or map, or the store is damaged; at an index, if the maps of that
        capture are not read as they were written.
    """

    def __init__(self, place: str | Path, *names: str) -> None:
        self._place = str(place)
        self._opened: tuple[int, Store] | None = None
        store = self._store()
        for name in names:
            if name not in store.types:
                message = f"{place}: there is no map '{name}'"
                raise InputError.unknown(message, name, store.types)
        self.arguments = store.arguments
        self.names = names or tuple(store.types)
        self._numbers = np.flatnonzero(store.statuses == DONE)
        self.pixel = next((kind.pixel for kind in store.types.values()), None)
        places = store.captures
        self.captures = [places[number] for number in self._numbers]

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: int) -> dict[str, NDArray[Any]]:
        store, number = self._store(), int(self._numbers[index])
        if not store.are_whole(slice(number, number + 1))[0]:
            raise InputError(
                f"{self._place}: the maps of {self.captures[index]} are damaged; the command of "
                "the batch repeats them"
            )
        return {name: store.map(name, number) for name in self.names}

    def _store(self) -> Store:
        if self._opened is None or self._opened[0] != os.getpid():
            need("batch", "a batch", "zarr", "numcodecs")
            from tactograph.rings.batch.store import open_store

            store = open_store(self._place)
            if store is None:
                raise InputError(f"{self._place}: there is no store of a batch")
            self._opened = os.getpid(), store
        return self._opened[1]
