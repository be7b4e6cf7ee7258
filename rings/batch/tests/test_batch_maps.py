"""A training loop's view of a store: whole maps of finished captures, in any process."""

import multiprocessing
from pathlib import Path

import numpy as np
import pytest

from rings.batch.tests.stores import new_store
from tactograph.graph import InputError
from tactograph.rings.batch.batch_maps import BatchMaps
from tactograph.rings.batch.entry import DONE, FAILED, Entry
from tactograph.rings.batch.map_types import MapType

MAPS = np.arange(60)[:, None, None] + np.zeros((2, 3))
"""The maps of a capture are its number."""


def stored(place: Path, count: int, failed: set[int], pending: set[int], chunk: int) -> Path:
    """Captures in shards of a size."""
    kinds = {"height": "float32", "shadow": "uint8"}
    types = {name: MapType((2, 3), kind, "", ("H", "W")) for name, kind in kinds.items()}
    store = new_store(place, types, chunk)
    store.append([str(number) for number in range(count)])
    for first in range(0, count, chunk):
        numbers = {*range(first, min(first + chunk, count))} - pending
        maps = {n: {name: MAPS[n].astype(kind) for name, kind in kinds.items()} for n in numbers}
        store.write({n: Entry(FAILED if n in failed else DONE, maps=maps[n]) for n in numbers})
    return place


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Four captures: the second failed, the last is pending."""
    return stored(tmp_path / "out.zarr", 4, {1}, {3}, 2)


def test_the_maps_of_finished_captures_are_read_one_by_one(place: Path) -> None:
    found = BatchMaps(place)
    assert (len(found), found.captures, found.names) == (2, ["0", "2"], ("height", "shadow"))
    np.testing.assert_array_equal(found[1]["height"], MAPS[2])
    assert found[-1]["shadow"].dtype == np.uint8
    assert list(BatchMaps(place, "height")[0]) == ["height"]
    with pytest.raises(IndexError):
        found[2]


@pytest.mark.parametrize("method", ["fork", pytest.param("spawn", marks=pytest.mark.slow)])
def test_processes_that_are_started_read_the_same(place: Path, method: str) -> None:
    found = BatchMaps(place, "height")
    first = found[0]  # the store is open here
    with multiprocessing.get_context(method).Pool(2) as pool:
        there = pool.map_async(found.__getitem__, [0, 1]).get(timeout=60)
    np.testing.assert_array_equal([each["height"] for each in there], MAPS[[0, 2]])
    np.testing.assert_array_equal(there[0]["height"], first["height"])


def test_a_missing_store_map_or_chunk_is_refused(place: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no\.zarr: there is no store of a batch"):
        BatchMaps(tmp_path / "no.zarr")
    with pytest.raises(InputError, match="no map 'hight'; did you mean 'height'"):
        BatchMaps(place, "hight")
    (place / "height" / "c" / "0" / "0" / "0").unlink()
    found = BatchMaps(place, "shadow")
    with pytest.raises(InputError, match="the maps of 0 are damaged; the command of the batch"):
        found[0]
    np.testing.assert_array_equal(found[1]["shadow"], MAPS[2])


@pytest.mark.slow
def test_the_loader_of_pytorch_takes_it(place: Path) -> None:
    torch = pytest.importorskip("torch", reason="'make test-lerobot' installs it")
    loader = torch.utils.data.DataLoader(BatchMaps(place), num_workers=2)
    assert [batch["height"][:, 0, 0].int().tolist() for batch in loader] == [[0], [2]]
