"""The maps of a batch, one capture after another or shuffled: what a training loop reads."""

import os
from collections.abc import Iterator
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.graph.batch.entry import DONE
from tactograph.graph.batch.store import Store, open_store
from tactograph.graph.errors import InputError, did_you_mean


class BatchMaps:
    """The finished captures of a store, a mapping of maps each.

    It is a map-style dataset of PyTorch, which needs ``len`` and an index.  Every process opens the
    store for itself, so that workers may be forked or spawned.

    Parameters
    ----------
    place
        A folder or URL, the ``--out`` of `tactograph batch`.
    *names
        The maps that are wanted; all, if none is named.

    Attributes
    ----------
    names
        The names of the maps.
    captures
        The place of each capture.
    given
        The values that the batch gave its graph.
    pixel
        The pixel size in mm; None if the graph puts out none.
    shards
        The indices of the captures in each shard of the store, the unit that is read at once.

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
            if name not in store.job.maps:
                has = did_you_mean(name, store.job.maps) or f"; it has {', '.join(store.job.maps)}"
                raise InputError(f"{place}: there is no map '{name}'{has}")
        self.given = store.job.given
        self.names = names or tuple(store.job.maps)
        self._numbers = np.flatnonzero(store.statuses == DONE)
        self.pixel = next((kind.pixel for kind in store.map_types().values()), None)
        places = store.captures
        self.captures = [places[number] for number in self._numbers]
        begin = np.flatnonzero(np.diff(self._numbers // store.chunk)) + 1
        self.shards = np.split(np.arange(len(self._numbers)), begin) if len(self._numbers) else []

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
            store = open_store(self._place)
            if store is None:
                raise InputError(f"{self._place}: there is no store of a batch")
            self._opened = os.getpid(), store
        return self._opened[1]


class ShuffledBatches:
    """Lists of indices of `BatchMaps` in random order: a ``batch_sampler`` of PyTorch's DataLoader.

    Shards are shuffled, and captures within some shards at a time, so that few are read at once.
    DataLoader deals batches out to its workers in turn; as long as there are whole batches for
    all of them, each worker reads shards of its own.  Every capture comes once in an epoch.

    Parameters
    ----------
    maps
        The captures.
    size
        Captures in a batch; the last may have fewer.
    workers
        ``num_workers`` of the DataLoader.
    shards
        Number of shards that a worker mixes.
    seed
        Of the order, which differs from epoch to epoch.
    """

    def __init__(
        self, maps: BatchMaps, size: int, *, workers: int = 1, shards: int = 4, seed: int = 0
    ) -> None:
        if min(size, shards) < 1 or workers < 0:
            raise InputError(f"size={size}, workers={workers}, shards={shards}: are too few")
        self._maps, self._size, self._mixed = maps, size, shards
        self._workers = max(workers, 1)  # 0: the process itself reads
        self._seed, self._epoch = seed, 0

    def __len__(self) -> int:
        return -(-len(self._maps) // self._size)

    def __iter__(self) -> Iterator[list[int]]:
        rng = np.random.default_rng([self._seed, self._epoch])
        self._epoch += 1
        order = rng.permutation(len(self._maps.shards))
        left: list[int] = []
        whole: list[list[list[int]]] = []
        for worker in range(self._workers):
            own = [self._maps.shards[shard] for shard in order[worker :: self._workers]]
            mixed = [own[first : first + self._mixed] for first in range(0, len(own), self._mixed)]
            indices = list(chain(*(rng.permutation(np.concatenate(m)).tolist() for m in mixed)))
            end = len(indices) // self._size * self._size
            whole.append(self._cut(indices[:end]))
            left += indices[end:]
        in_turn = chain(*zip_longest(*whole))
        return chain((batch for batch in in_turn if batch is not None), self._cut(left))

    def _cut(self, indices: list[int]) -> list[list[int]]:
        return [indices[at : at + self._size] for at in range(0, len(indices), self._size)]
