"""The first run on a device: NumPy computes a single touch while its kernels are built."""

import signal
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from tactograph.graph.commands import RunOptions, first_start
from tactograph.graph.disk import disk_cache
from tests.graph.conftest import Command, Outcome, one_line

CAPTURES = Path(__file__).parents[1] / "data" / "far28"
GRAPH = """
format: 1
params: {capture: {kind: path}, out: {kind: path}}
nodes:
  taken: {op: read_capture, with: {folder: $capture}}
  small: {op: coarsen, in: {light: taken.image}, with: {factor: 8}}
outputs: {small: small}
"""


@pytest.fixture
def run(about: Command, programs: Path, tmp_path: Path) -> Command:
    """Run the graph where no kernel is built yet."""
    assert not programs.exists()

    def run_graph(*words: str, capture: Path = CAPTURES / "cat_film", text: str = GRAPH) -> Outcome:
        places = f"capture={capture}", f"out={tmp_path}"
        done = about("run", text, *places, "--keep", "small", *words)
        assert done.code == 0, done.err
        return done

    return run_graph


def kept(folder: Path) -> np.ndarray:
    return np.load(folder / "kept" / "1" / "small.npy")


def test_a_first_touch_waits_for_no_compiler_and_a_second_launches_kernels(
    run: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = run()
    why = "no kernel is built for it yet"
    assert first.err == f"fallback: small runs on numpy: opencl is preferred, but {why}\n"
    height, building, built = first.out.splitlines()[-3:]
    assert height.startswith("1: ")
    assert "later runs; Ctrl-C is safe" in building
    assert "1 programs are built for Portable" in built
    on_numpy = kept(tmp_path)
    compiled = Mock(side_effect=AssertionError("compiled"))
    monkeypatch.setattr("tactograph.graph.backends.programs._onto_disk", compiled)
    second = run()
    assert "fallback" not in second.err
    assert "on opencl" in second.out
    np.testing.assert_allclose(kept(tmp_path), on_numpy, atol=1e-6)


@pytest.mark.parametrize(
    "words", [("--strict",), ("--backend", "opencl"), ("--device", "Portable")]
)
def test_whoever_chooses_a_back_end_gets_it(run: Command, words: tuple[str, ...]) -> None:
    done = run(*words)
    assert "fallback" not in done.err
    assert "built" not in done.out


def test_a_quiet_first_run_builds_the_kernels_too(run: Command, tmp_path: Path) -> None:
    first = run("--quiet")
    assert first.out == ""
    assert first.err.startswith("fallback: ")
    assert run().err == ""


def test_a_node_that_is_bound_to_the_device_runs_there(run: Command) -> None:
    assert (
        "fallback" not in run(text=GRAPH.replace("factor: 8}", "factor: 8}, backend: opencl")).err
    )


def test_what_no_folder_can_keep_is_built_for_the_run_alone(
    run: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(disk_cache.FOLDER_VARIABLE, str(tmp_path / "graph.yaml" / "cache"))
    assert "fallback" not in run().err


def test_a_stream_of_several_touches_runs_on_the_device(run: Command, tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / "touches" / name).parent.mkdir(exist_ok=True)
        (tmp_path / "touches" / name).symlink_to(CAPTURES / "cat_film")
    done = run(capture=tmp_path / "touches")
    assert "fallback" not in done.err
    assert "on opencl" in done.out


def test_a_large_image_is_left_to_the_device(run: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(first_start, "MAX_NUMPY_VALUES", 4 * 320 * 240 - 1)
    assert "on opencl" in run().out


def test_what_cannot_be_read_begins_no_process(
    about: Command, run: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(first_start.subprocess, "Popen", Mock(side_effect=AssertionError))
    one_line(about("run", GRAPH, f"capture={tmp_path}", f"out={tmp_path}"))


def test_nothing_is_built_any_more_once_a_run_has_failed() -> None:
    options = RunOptions((), (), None, None, strict=False)
    with pytest.raises(KeyError), first_start.KernelBuilder("reconstruct", (), options) as builder:
        raise KeyError
    assert builder._process.returncode == -signal.SIGTERM


def test_ctrl_c_after_the_result_ends_the_building_alone(
    run: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    stopped = Mock(side_effect=[KeyboardInterrupt, ("", "")])
    monkeypatch.setattr(first_start.subprocess.Popen, "communicate", stopped)
    assert run().out.endswith("stopped; the next run builds the rest\n")
