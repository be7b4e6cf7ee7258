"""Without its packages each feature names the extra, and does nothing."""

import sys
from pathlib import Path

import pytest

from tactograph.graph import InputError
from tactograph.rings.batch.batch_maps import BatchMaps
from tests.graph.conftest import Command, one_line
from tests.graph.test_extras import CAPTURE


@pytest.fixture(params=["zarr", "numcodecs"])
def hidden(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> str:
    """An empty folder to work in, and a package that is not installed there."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, request.param, None)
    return str(request.param)


def test_the_command_names_the_extra(tactograph: Command, hidden: str) -> None:
    words = ("paper", "calibration=cal.npz", "--over", CAPTURE, "--out", "a.zarr")
    message = one_line(tactograph("batch", *words))
    assert message.endswith(f"a batch needs {hidden}: pip install 'tactograph[batch]'\n")
    assert not [*Path().iterdir()]


def test_readers_of_a_store_name_the_extra(tactograph: Command, hidden: str) -> None:
    Path("a.zarr").mkdir()
    assert f"needs {hidden}: pip install 'tactograph[batch]'" in one_line(
        tactograph("show", "a.zarr")
    )
    with pytest.raises(InputError, match=rf"needs {hidden}: .*\[batch\]"):
        BatchMaps("a.zarr")


def test_help_needs_no_extra(tactograph: Command, hidden: str) -> None:
    assert "--retry-failed" in tactograph("batch", "--help").out
