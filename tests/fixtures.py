"""Shared by all tests: the device, captures of known shapes, and one calibration of each rig."""

import fcntl
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import get_args

import hypothesis
import pytest

from tactograph.graph.backends.devices import choose_device
from tactograph.graph.backends.kernel import WAIT_VARIABLE
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes.optics.film import FilmPart

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared" / "data"
# The first example on a busy machine imports and compiles.
hypothesis.settings.register_profile("untimed", deadline=None)
hypothesis.settings.load_profile("untimed")
# Tests must neither read nor fill the user's cache; see `once`.
os.environ["TACTOGRAPH_CACHE"] = "off"
# Most programs are built once or twice; PoCL's own cache serves the second build.
os.environ["PYOPENCL_NO_CACHE"] = "1"
needs_rings = pytest.mark.skipif(
    not any((ROOT / "rings").glob("*/nodes")), reason="states something about the rings"
)
MadeOnce = Callable[[str, Callable[[Path], object]], Path]
Calibration = Callable[[str], str]
RIG_PIXEL_MM = {"far28": 1 / 14, "near33": 1 / 14, "far28_vga16": 1 / 28}


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark further cases of a test as slow, and put long tests first.

    Otherwise one worker waits at the end for the last test of the other.
    """
    first: dict[str, pytest.Item] = {}
    for item in items:
        test = item.nodeid.partition("[")[0]
        if item.get_closest_marker("one_case") and first.setdefault(test, item) is not item:
            item.add_marker("slow")
    items.sort(key=lambda item: "pipelines" not in item.path.parts)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Name a kernel that kills the process, except in a test that measures times."""
    os.environ[WAIT_VARIABLE] = "0" if item.get_closest_marker("realtime") else "1"


def without_pictures(graph: Graph) -> Graph:
    """A calibration without its pictures, which are a quarter of its time."""
    nodes = {name: entry for name, entry in graph.nodes.items() if not entry.op.startswith("plot_")}
    return replace(graph, nodes=nodes)


def without_ranks(graph: Graph) -> Graph:
    """A calibration without its simulated touches, which take most of its time."""
    nodes = {name: entry for name, entry in graph.nodes.items() if entry.op != "rank_checks"}
    return replace(graph, nodes=nodes)


def of_matt_film(graph: Graph) -> Graph:
    """A calibration that knows the film to be matt; its search for more takes half of its time.

    For films that are matt, in tests that state something else.
    """
    matt = {
        name: replace(entry, settings={**entry.settings, "without": get_args(FilmPart)})
        for name, entry in graph.nodes.items()
        if entry.op == "fit_film"
    }
    return replace(graph, nodes={**graph.nodes, **matt})


def few_ranks(graph: Graph) -> Graph:
    """A calibration with a quarter of its simulated touches, enough to doubt a wrong touch."""
    few = {
        name: replace(entry, settings={**entry.settings, "count": 32})
        for name, entry in graph.nodes.items()
        if entry.op == "rank_checks"
    }
    return replace(graph, nodes={**graph.nodes, **few})


class Raytraced:
    """Captures of known shapes by an independent renderer: ``raytraced / RIG / CAPTURE``.

    Two rigs are the repository's own; tests of other rigs are skipped where those are absent.
    """

    def __truediv__(self, rig: str) -> Path:
        for folder in (ROOT / "tests" / "data", SHARED / "raytraced"):
            if (folder / rig).is_dir():
                return folder / rig
        pytest.skip(f"the ray-traced rig {rig} is not in {SHARED / 'raytraced'}")


def python(
    *words: object, code: int = 0, cwd: Path | None = None, **environment: object
) -> subprocess.CompletedProcess[str]:
    """Run Python in a separate process, which has to end with that code."""
    command = [sys.executable, *map(str, words)]
    env = {**os.environ, **{name: str(value) for name, value in environment.items()}}
    done = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, timeout=600)
    assert done.returncode == code, done.stdout + done.stderr
    return done


def real_data(name: str) -> Path:
    """A folder of published images of a real sensor; the test is skipped without it."""
    folder = SHARED / "real" / name
    if not folder.is_dir():
        pytest.skip(f"the real captures {name} are not in {SHARED / 'real'}")
    return folder


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--device", help="A part of the name of the OpenCL device to test on.")
    small = "Compare kernels on small images only, for a slow device."
    parser.addoption("--small-images", action="store_true", help=small)


@pytest.fixture(scope="session")
def device(request: pytest.FixtureRequest) -> OpenCL:
    """An OpenCL device; without one the tests that need it fail, they are not skipped."""
    chosen, reason = choose_device(request.config.getoption("--device"))
    assert chosen is not None, f"{reason}; 'make test' installs one"
    return OpenCL(chosen)


@pytest.fixture(scope="session")
def raytraced() -> Raytraced:
    return Raytraced()


@pytest.fixture(scope="session")
def groove() -> Path:
    """Images of a real sensor with six LEDs."""
    return real_data("groove_6led")


@pytest.fixture(scope="session", autouse=True)
def once(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """A folder that all tests of all workers share.

    The engine's cache of this session lies there.  It holds results that are slow and the same in
    several tests.
    """
    base = tmp_path_factory.getbasetemp()
    folder = base / "once" if worker_id == "master" else base.parent / "once"
    folder.mkdir(exist_ok=True)
    os.environ["TACTOGRAPH_CACHE"] = str(folder / "kept")
    return folder


@pytest.fixture(scope="session")
def made_once(once: Path) -> MadeOnce:
    """Make a file, or a folder, by its name once for all tests of all workers."""

    def make(name: str, maker: Callable[[Path], object]) -> Path:
        path = once / name
        with (once / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not path.exists():
                maker(path)
        return path

    return make


def images_of(rig: Path) -> dict[str, object]:
    """The inputs that calibrate a ray-traced rig: one ball and the flat frame."""
    known = {"ball_radius_mm": 7.0, "pixel_size_mm": RIG_PIXEL_MM[rig.name]}
    return {"capture": str(rig / "calibration"), "flat": str(rig / "flat"), **known}


def simulated_sensor(
    folder: Path, *, radius_mm: float = 5.0, ranked: bool = True, **rig: float
) -> Path:
    """A folder with a ball's press, the flat frame and the calibration of a simulated sensor."""
    ball, flat = str(folder / "ball"), str(folder / "flat")
    known = {"ball_radius_mm": radius_mm, "pixel_size_mm": rig["pixel_size_mm"]}
    for graph, params in (
        ("simulate", {"radius_mm": radius_mm, "seed": 1, "out": ball, **rig}),
        ("simulate_flat", {"seed": 2, "out": flat, **rig}),
        ("calibrate", {"capture": ball, "flat": flat, "out": str(folder / "cal.npz"), **known}),
    ):
        bare = of_matt_film(without_pictures(read_graph(graph)))
        list(open_pipeline(bare if ranked else without_ranks(bare), params).items())
    return folder


@pytest.fixture(scope="session")
def calibration(raytraced: Raytraced, made_once: MadeOnce) -> Calibration:
    """The calibration of a ray-traced rig: one ball and the flat frame; the LEDs are found.

    Beside it are its warnings, of the same name with the suffix ``.warnings``.
    """

    def calibrate(name: str) -> str:
        rig = raytraced / name

        def write(file: Path) -> None:
            params = images_of(rig) | {"out": str(file)}
            (result,) = open_pipeline(without_pictures(read_graph("calibrate")), params).items()
            file.with_suffix(".warnings").write_text("\n".join(result.warnings))

        return str(made_once(f"{name}.npz", write))

    return calibrate
