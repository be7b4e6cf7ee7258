"""The layout of maps in a store: large ones alone, small ones several together."""

import errno
import json
import pickle
from pathlib import Path
from typing import Any

import pytest
import zarr

from rings.batch.tests.stores import new_store
from tactograph.graph.errors import InputError
from tactograph.rings.batch.entry import DONE, FAILED, Entry
from tactograph.rings.batch.map_types import MapType, captures_together
from tactograph.rings.batch.store import open_store
from tests.graph.conftest import Command

HEIGHT = {"height": MapType((2, 3), "float32", "mm", ("H", "W"))}


@pytest.mark.parametrize(
    ("size", "together"),
    [((24, 32), 32), ((480, 640), 32), ((1232, 1640), 4), ((4096, 3000), 1), ((9000, 9000), 1)],
)
def test_larger_maps_are_written_fewer_at_a_time(size: tuple[int, int], together: int) -> None:
    height, shadow = (MapType(size, dtype, "", ("H", "W")) for dtype in ("float32", "uint8"))
    assert captures_together([height, shadow]) == together


@pytest.mark.parametrize(
    ("shape", "chunk", "together"),
    [((240, 320), 16, 4), ((240, 320), 7, 1), ((480, 640), 16, 1), ((2, 3), 16, 16)],
)
def test_small_maps_are_compressed_together(
    tmp_path: Path, shape: tuple[int, int], chunk: int, together: int
) -> None:
    place = str(tmp_path / "out.zarr")
    new_store(place, {"height": MapType(shape, "float32", "mm", ("H", "W"))}, chunk)
    array = zarr.open_group(place, mode="r")["height"]
    assert isinstance(array, zarr.Array)
    assert array.shards == (chunk, *shape)
    assert array.chunks == (together, *shape)


@pytest.mark.parametrize("failing", [1, 3])
def test_a_full_disk_leaves_no_half_store(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: int
) -> None:
    place, ordinary, made = tmp_path / "out.zarr", zarr.Group.create_array, []

    def fails(*words: Any, **options: Any) -> Any:
        made.append(words)
        if len(made) == failing:
            raise OSError(errno.ENOSPC, "No space left on device")
        return ordinary(*words, **options)

    (place / "mine").mkdir(parents=True)
    with monkeypatch.context() as patch:
        patch.setattr(zarr.Group, "create_array", fails)
        with pytest.raises(InputError, match="cannot be made: No space left on device"):
            new_store(place, HEIGHT)
    assert [*place.iterdir()] == [place / "mine"]
    new_store(place, HEIGHT)


class Touching:
    """Makes a file where it is unpickled."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self._file,)


def test_a_store_of_version_2_is_refused_and_its_pickles_are_not_read(tmp_path: Path) -> None:
    hostile, ordinary = tmp_path / "hostile.zarr", tmp_path / "ordinary.zarr"
    about = new_store(ordinary, HEIGHT)._group.attrs["tactograph"]
    zarr.create_group(str(hostile), zarr_format=2, attributes={"tactograph": about})
    pickled = {
        "zarr_format": 2, "shape": [1], "chunks": [1], "dtype": "|O", "fill_value": None,
        "order": "C", "filters": [{"id": "pickle"}], "compressor": None,
    }  # fmt: skip
    for name in ordinary.iterdir():
        if name.is_dir():
            array = hostile / name.name
            array.mkdir()
            (array / ".zarray").write_text(json.dumps(pickled))
            (array / "0").write_bytes(pickle.dumps(Touching(tmp_path / "ran")))
    before = sorted(hostile.rglob("*"))
    with pytest.raises(InputError, match="no store of a batch, but of Zarr version 2"):
        open_store(str(hostile))
    assert not (tmp_path / "ran").exists()
    assert sorted(hostile.rglob("*")) == before


@pytest.mark.parametrize("arguments", [None, 3, [1], "x"])
def test_a_store_whose_job_is_of_other_types_is_refused(tmp_path: Path, arguments: Any) -> None:
    place = tmp_path / "out.zarr"
    new_store(place, HEIGHT)
    about = json.loads((place / "zarr.json").read_text())
    about["attributes"]["tactograph"]["identity"]["arguments"] = arguments
    (place / "zarr.json").write_text(json.dumps(about))
    with pytest.raises(InputError, match="no store of a batch"):
        open_store(str(place))


@pytest.mark.parametrize(("name", "text"), [("", "null"), ("status", '{"fill_value": 300}')])
def test_descriptions_not_by_zarr_are_refused(tmp_path: Path, name: str, text: str) -> None:
    place = tmp_path / "out.zarr"
    new_store(place, HEIGHT)
    file = place / name / "zarr.json"
    changed = json.loads(text)
    file.write_text(json.dumps(changed and json.loads(file.read_text()) | changed))
    with pytest.raises(InputError, match="no store of a batch"):
        open_store(str(place))


def test_a_store_shows_the_state_of_each_capture(tmp_path: Path, tactograph: Command) -> None:
    place = tmp_path / "out.zarr"
    store = new_store(place, {})
    store.append(["a", "b", "c"])
    store.write({0: Entry(DONE, warnings=["too bright"]), 1: Entry(FAILED, "all black")})
    printed = tactograph("show", place).out
    assert "captures: 3, done 1, failed 1, pending 1" in printed
    assert "  b: all black" in printed
    assert "  1 x too bright" in printed


@pytest.mark.parametrize("text", ["{", "3", "[[1]]"])
def test_figures_that_cannot_be_read_are_none(tmp_path: Path, text: str) -> None:
    store = new_store(tmp_path / "out.zarr", {})
    store.append(["a"])
    store.write({0: Entry(DONE, figures={"trust": 1.0})})
    figures: Any = zarr.open_group(str(tmp_path / "out.zarr"))["figures"]
    figures[0] = text
    assert store.read_all()[0].figures == {}
