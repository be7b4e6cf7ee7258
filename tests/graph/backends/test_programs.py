"""Programs that one pipeline has built are used by the next."""

import os
import re
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pyopencl as cl
import pytest

from tactograph.graph.backends import build_ahead, pocl_source
from tactograph.graph.backends.devices import choose_device
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.backends.programs import (
    POCL_OF_BINARIES,
    _cache_file,
    ahead,
    build,
    context_of,
    is_ready,
)
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.disk import disk_cache
from tests.graph.conftest import SLOPES, Command, Write, one_line


def test_queues_of_a_device_share_a_program_and_disturb_no_launch(
    device: OpenCL, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, sizes = find_node("label_lit"), {"K": 2, "H": 3, "W": 4}
    light = np.full((2, 3, 4), 0.5, np.float32)
    low = device.prepare(node, {"black": 0.4, "which": "lit"}, sizes)
    low.launch({"light": device.upload(light)})
    built: list[object] = []
    monkeypatch.setattr(cl.Program, "build", lambda *arguments, **more: built.append(arguments))
    chosen, _ = choose_device()
    assert chosen is not None
    another = OpenCL(chosen)
    high = another.prepare(node, {"black": 0.6, "which": "lit"}, sizes)
    assert not built
    for queue, prepared, marked in ((device, low, 3), (another, high, 0), (device, low, 3)):
        (mask,) = prepared.launch({"light": queue.upload(light)})[0].values()
        assert (queue.download(mask) == marked).all()


LAUNCHES = """
import numpy as np
from tactograph.graph.backends.devices import choose_device
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.declare.find_node import find_node

device = OpenCL(choose_device("Portable")[0])
for height in (3, 300):
    sizes = {"K": 2, "H": height, "W": 4}
    prepared = device.prepare(find_node("label_lit"), {"black": 0.4, "which": "lit"}, sizes)
    prepared.launch({"light": device.upload(np.zeros((2, height, 4), np.float32))})
    device.finish()
"""


def test_a_kernel_and_its_binary_are_compiled_once_for_all_sizes(programs: Path) -> None:
    pocl = programs.with_name("pocl")
    pocl.mkdir()
    variables = {k: v for k, v in os.environ.items() if not k.startswith("POCL_")}
    environment = {**variables, "POCL_CACHE_DIR": str(pocl)}
    subprocess.run([sys.executable, "-c", LAUNCHES], env=environment, check=True)
    assert len(list(pocl.rglob("label_lit.so"))) == 1


def test_the_next_process_reads_no_code_that_was_translated(programs: Path) -> None:
    pocl = programs.with_name("pocl")
    pocl.mkdir()
    environment = {**os.environ, "POCL_CACHE_DIR": str(pocl)}
    for _ in range(2):
        subprocess.run([sys.executable, "-c", LAUNCHES], env=environment, check=True)
    if not any(POCL_OF_BINARIES in platform.version for platform in cl.get_platforms()):
        pytest.skip("this version's binaries are read as they are")
    folders = [file.parent for file in pocl.rglob("program.no")]
    assert any(list(folder.rglob("label_lit.so")) for folder in folders)
    assert not any((folder / "program.bc").exists() for folder in folders)


SEVEN = """
__kernel void seven(__global int *out) { out[get_global_id(0)] = NUMBER; }
"""


def seven(device: OpenCL, number: int = 7) -> int:
    """The output of a kernel that is built as if in a process of its own."""
    build.cache_clear()
    (handle,) = device.context.devices
    program = build(context_of(handle), SEVEN, (f"-DNUMBER={number}",))
    out = device.upload(np.zeros(1, np.int32))
    cl.Kernel(program, "seven")(device.queue, (1,), None, out.buffer)
    return int(device.download(out)[0])


def test_a_program_that_was_built_is_not_compiled_by_the_next_process(
    programs: Path, device: OpenCL, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert seven(device) == 7
    monkeypatch.setattr(cl._cl, "_Program", only_binaries(cl._cl._Program))
    assert seven(device) == 7
    with pytest.raises(AssertionError, match="compiled"):
        seven(device, 8)


def only_binaries(program: type) -> object:
    def build_checked(*arguments: object) -> object:
        assert len(arguments) == 3, "compiled from its source"
        return program(*arguments)

    return build_checked


def test_programs_are_built_by_another_process_while_this_one_continues(
    programs: Path, device: OpenCL, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build_ahead, "cores", lambda: 2)
    numbers = range(build_ahead.MIN_AHEAD_PROGRAMS)
    needed = [(SEVEN, (f"-DNUMBER={number}",)) for number in numbers]
    wants_constants = (SEVEN, ())
    build_ahead.build_ahead(device.context, needed, [wants_constants])
    assert build_ahead.helpers[-1].wait() == 0
    monkeypatch.setattr(cl._cl, "_Program", only_binaries(cl._cl._Program))
    assert [seven(device, number) for number in numbers] == [*numbers]


def test_the_first_run_does_not_compile_warmed_programs(
    programs: Path,
    tactograph: Command,
    write: Write,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    graph, file = write(SLOPES), tmp_path / "height.npy"
    np.save(file, np.zeros((6, 8), np.float32))
    warmed = tactograph("warm", graph)
    assert "2 programs are built for" in warmed.out
    assert "the rest follows with file" in warmed.out
    build.cache_clear()
    compiled = Mock(side_effect=AssertionError("compiled"))
    monkeypatch.setattr("tactograph.graph.backends.programs._onto_disk", compiled)
    assert tactograph("run", graph, f"file={file}").code == 0
    assert "the rest" not in tactograph("warm", graph, f"file={file}").out
    assert "no kernels to build" in one_line(tactograph("warm", graph, "--backend", "numpy"))


def test_a_kernel_that_needs_its_launch_is_not_built_ahead_and_prints_nothing(
    programs: Path, device: OpenCL, capfd: pytest.CaptureFixture[str]
) -> None:
    assert device.build([find_node("film_bounce")]) == 0
    assert capfd.readouterr().err == ""
    (handle,) = device.context.devices
    assert is_ready(handle, *device.compiled(find_node("film_bounce")).recipe({})), "tried once"


HOLDS = """
import sys, time
from pathlib import Path
from tactograph.graph.backends.programs import _alone

held, *others = map(Path, sys.argv[1:])
with _alone(held):
    print("held", flush=True)
    for _ in range(3000):
        if all(other.exists() for other in others):
            sys.exit()
        time.sleep(0.01)
sys.exit("nothing else was built")
"""


def test_a_process_builds_something_else_while_another_builds_what_it_needs(
    programs: Path, device: OpenCL, capfd: pytest.CaptureFixture[str]
) -> None:
    """A program that needs its launch prints no errors of the compiler."""
    (handle,) = device.context.devices
    numbers = "7", "needs_its_launch", "9"
    recipes = [(SEVEN, (f"-DNUMBER={number}",)) for number in numbers]
    files = [str(_cache_file(handle, *recipe)) for recipe in recipes]
    command = [sys.executable, "-c", HOLDS, *files]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        ahead.extend(recipes[1:])
        assert seven(device) == 7
    assert other.returncode == 0
    assert capfd.readouterr().err == ""


def test_a_program_is_built_from_its_source_if_the_cached_one_is_unusable(
    programs: Path, device: OpenCL
) -> None:
    assert seven(device) == 7
    (file,) = programs.rglob("*.cached")
    for body in (b"damaged", b"tactograph kept 1\n00000000\n"):
        file.write_bytes(body)
        assert seven(device) == 7
    disk_cache.write_cached(file, b"no program")
    assert seven(device) == 7


@pytest.mark.parametrize(
    ("name", "value"), [(disk_cache.FOLDER_VARIABLE, "off"), ("PYOPENCL_NO_CACHE", "1")]
)
def test_no_program_is_cached_where_caching_is_off(
    programs: Path, device: OpenCL, monkeypatch: pytest.MonkeyPatch, name: str, value: str
) -> None:
    monkeypatch.setenv(name, value)
    assert seven(device) == 7
    assert not programs.exists()


def test_a_program_includes_all_overloads_of_the_functions_it_names_and_no_others(
    device: OpenCL,
) -> None:
    program = pocl_source.pocl_source("float root(float x) { return sqrt(x); }")
    if not program[1]:
        pytest.skip("PoCL's declarations are not beside its library")
    assert {"sqrt(float);", "sqrt(float16);", "sqrt(double);"} <= set(
        re.split(r"[ \n]", program[0])
    )
    assert "acosh" not in program[0]


def test_a_program_is_built_as_usual_where_its_declarations_do_not_compile(
    programs: Path, device: OpenCL, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pocl_source, "_declarations", lambda: [(None, "#error")])
    assert seven(device) == 7
    monkeypatch.setattr(pocl_source, "_declarations", list)
    assert seven(device, 8) == 8


def test_a_kernel_whose_lanes_have_known_places_becomes_a_function(device: OpenCL) -> None:
    head = "LANED __kernel void f(__global float *a, const int N)\n"
    alone, places = (f"{head}{{\n    {grid};\n}}" for grid in ("GRID_LANES(i, n, N)", "GRID_2(y)"))
    assert "code_of_f(a, N, get_global_id(0))" in pocl_source.pocl_source(alone)[0]
    assert "code_of_f" not in pocl_source.pocl_source(places)[0]
    shared = alone.replace("__global float *a,", "SHARED,")
    assert "code_of_f" not in pocl_source.pocl_source(shared)[0]
    source, options = device.compiled(find_node("coarsen")).recipe({})
    text, more = pocl_source.pocl_source(source)
    assert "code_of_coarsen" in text
    cl.Program(device.context, text).build([*options, *more])
