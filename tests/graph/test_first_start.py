"""The first run on a device: NumPy computes a single touch while its kernels are built."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
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
def run(about: Command, programs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Command:
    """Run the graph where no kernel is built yet, as if cores were idle."""
    assert not programs.exists()
    monkeypatch.setattr(first_start, "BUILDER_NICENESS", 0)

    def run_graph(*words: str, capture: Path = CAPTURES / "cat_film", text: str = GRAPH) -> Outcome:
        places = f"capture={capture}", f"out={tmp_path}"
        done = about("run", text, *places, "--keep", "small", *words)
        assert done.code == 0, done.err
        return done

    return run_graph


def small_of(folder: Path) -> np.ndarray:
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
    on_numpy = small_of(tmp_path)
    compiled = Mock(side_effect=AssertionError("compiled"))
    monkeypatch.setattr("tactograph.graph.backends.programs._onto_disk", compiled)
    second = run()
    assert "fallback" not in second.err
    assert "on opencl" in second.out
    np.testing.assert_allclose(small_of(tmp_path), on_numpy, atol=1e-6)


MORE = GRAPH.replace("outputs:", "  lit: {op: label_lit, in: {light: taken.image}}\noutputs:")
MORE = MORE.replace("{small: small}", "{small: small, lit: lit}")


def test_a_graph_has_a_first_start_if_some_of_its_kernels_are_not_built(run: Command) -> None:
    run()
    first = run(text=MORE)
    why = "opencl is preferred, but its kernels are not built yet (1 of 2 programs)"
    assert first.err == f"fallback: every node runs on numpy: {why}\n"
    assert "2 programs are built" in first.out
    assert run(text=MORE).err == ""


def test_with_fewer_missing_kernels_numpy_computes_only_smaller_images(
    run: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    run()
    monkeypatch.setattr(first_start, "MAX_NUMPY_VALUES", 2 * 4 * 320 * 240 - 1)
    assert "on opencl" in run(text=MORE).out


@pytest.mark.parametrize(
    "words", [("--strict",), ("--backend", "opencl"), ("--device", "Portable")]
)
def test_a_back_end_that_the_user_chooses_is_used(run: Command, words: tuple[str, ...]) -> None:
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


def test_without_a_cache_folder_programs_are_built_for_the_run_alone(
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


def test_a_capture_that_cannot_be_read_starts_no_process(
    about: Command, run: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(first_start.subprocess, "Popen", Mock(side_effect=AssertionError))
    one_line(about("run", GRAPH, f"capture={tmp_path}", f"out={tmp_path}"))


@pytest.mark.parametrize("wanted", [True, False])
def test_drawing_libraries_are_imported_in_a_thread_only_if_a_node_draws(
    wanted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(first_start, "Thread", thread := Mock())
    saved = SimpleNamespace(settings={"pictures": wanted})
    first_start.import_pictures(SimpleNamespace(tasks={"save": saved}))
    assert thread.called == wanted


def test_building_stops_once_a_run_has_failed() -> None:
    options = RunOptions((), (), None, None, strict=False)
    with pytest.raises(KeyError), first_start.KernelBuilder("reconstruct", (), options) as builder:
        raise KeyError
    assert builder._process.returncode == -signal.SIGTERM


WAITS = """
from tactograph.graph.commands import RunOptions
from tactograph.graph.commands.first_start import KernelBuilder

with KernelBuilder("reconstruct", (), RunOptions((), (), None, None, strict=False)) as builder:
    print(builder._process.pid, flush=True)
    print(builder.last_line())
"""


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads /proc, as on Linux")
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_the_builder_of_kernels_ends_with_the_command_that_waits_for_it(
    programs: Path, how: signal.Signals
) -> None:
    waiting = [sys.executable, "-c", WAITS]
    with subprocess.Popen(waiting, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        stat = Path("/proc", process.stdout.readline().strip(), "stat")
        assert is_running(stat)
        # Only a command that waits for its builder prints that it is stopped.
        assert waited_for(lambda: state_of(Path("/proc", str(process.pid), "stat")) == "S")
        process.send_signal(how)
        output = process.stdout.read()
    assert output == ("stopped; the next run builds the rest\n" if how == signal.SIGINT else "")
    assert waited_for(lambda: not is_running(stat))


def state_of(stat: Path) -> str:
    """The state of a process: "S" sleeps; "Z" has ended, and nobody has fetched its exit code."""
    try:
        return stat.read_text().rpartition(") ")[2][0]
    except FileNotFoundError:
        return "Z"


def is_running(stat: Path) -> bool:
    return state_of(stat) != "Z"


def waited_for(holds: Callable[[], bool], seconds: float = 60) -> bool:
    """Wait until a condition holds, and return whether it does."""
    end = time.monotonic() + seconds
    while not holds() and time.monotonic() < end:
        time.sleep(0.02)
    return holds()
