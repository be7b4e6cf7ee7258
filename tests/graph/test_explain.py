"""``explain`` marks steps whose results may come from disk."""

from pathlib import Path

import pytest

from tests.graph.conftest import SLOPES, Command


def test_a_step_that_may_be_taken_from_disk_is_marked(
    about: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    graph = SLOPES.replace("nodes:", "prefer: [numpy]\nnodes:")
    monkeypatch.setenv("TACTOGRAPH_CACHE", str(tmp_path / "cache"))
    assert "unless on disk" not in about("explain", graph).out
    (tmp_path / "cache").mkdir(exist_ok=True)
    (tmp_path / "cache" / "height_slopes-0.cached").touch()
    marked = [line for line in about("explain", graph).out.splitlines() if "unless" in line]
    assert [line.split()[1] for line in marked] == ["slope"]


def test_a_turn_that_is_not_run_is_one_line(tactograph: Command) -> None:
    unused = [line for line in tactograph("explain", "precise_stream").out.splitlines()
              if line.endswith("nothing reads it")]  # fmt: skip
    assert [line.split(":")[0] for line in unused] == ["rough.4.bounce", "passes.1", "passes.2"]
    listed = tactograph("explain", "precise_stream", "--all").out
    assert "\npasses.2.matt: not run; nothing reads it\n" in listed
