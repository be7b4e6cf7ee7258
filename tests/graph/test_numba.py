"""The host's compiled back end: what it hands to a node's function, and what it refuses."""

from __future__ import annotations

import multiprocessing
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError, NodeError, Wanted, load
from tactograph.graph.backends import numba
from tactograph.graph.backends.numba import Compiled
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.plan import backends
from tests.graph.conftest import STREAM, Write
from tests.graph.toys import halves

IMAGE = np.linspace(0, 1, 3 * 40 * 500, dtype=np.float32).reshape(3, 40, 500)


@pytest.fixture
def compiled(toys: list[str]) -> Compiled:
    return Compiled(find_node("halves"))


def test_it_is_called_as_the_node_is(compiled: Compiled) -> None:
    """On an image that several threads share, and on one that is too small for that."""
    for image in (IMAGE, IMAGE[:, :3, :5]):
        found, expected = compiled(image), halves(image)
        assert type(found) is type(expected)
        np.testing.assert_array_equal(found.low, expected.low)
        np.testing.assert_array_equal(found.high, expected.high)


def test_what_nobody_reads_is_not_made(compiled: Compiled) -> None:
    found = compiled(IMAGE, wanted=Wanted(frozenset({"high"})))
    assert found.low is None
    np.testing.assert_array_equal(found.high, IMAGE * np.float32(1.5))


def test_images_in_any_memory_are_read_alike(compiled: Compiled) -> None:
    """Read-only, upside down or as columns: nothing is compiled again for it."""
    frozen = IMAGE.copy()
    frozen.flags.writeable = False
    for image in (frozen, IMAGE[:, ::-1], np.asfortranarray(IMAGE)):
        np.testing.assert_array_equal(compiled(image).low, image * np.float32(0.5))


def test_a_process_that_is_forked_has_threads_of_its_own(compiled: Compiled) -> None:
    """As data loaders do it: the parent's threads are not there."""
    compiled(IMAGE)
    child = multiprocessing.get_context("fork").Process(target=compiled, args=(IMAGE,))
    child.start()
    child.join(20)
    child.kill()
    assert child.exitcode == 0


def test_any_number_of_planes_is_compiled_for_itself(compiled: Compiled) -> None:
    for count in (1, 3, 2):
        image = np.ones((count, 2, 2), np.float32)
        assert compiled(image).low.shape == image.shape


def test_a_choice_and_an_input_that_is_left_out() -> None:
    light = np.random.default_rng(0).uniform(0, 1, (4, 6, 7)).astype(np.float32)
    flat, dark = np.ones_like(light), np.zeros((6, 7), np.float32)
    node = find_node("flat_field")
    np.testing.assert_array_equal(Compiled(node)(light, flat, dark), node(light, flat, dark))


def test_a_function_with_other_arguments_than_declared_is_refused(toys: list[str]) -> None:
    node = replace(
        find_node("halves"), name="flat_field", kernel_package="tactograph.kernels.light"
    )
    with pytest.raises(NodeError, match=r"flat_field_numba\.py: the function takes image, flat, "):
        Compiled(replace(node, fixed=()))


def test_a_file_that_is_missing_is_named(toys: list[str]) -> None:
    node = replace(find_node("halves"), name="thirds", fixed=())
    with pytest.raises(NodeError, match=r"node 'thirds': .*thirds_numba"):
        Compiled(node)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("    out[0] = imgae[0]\n", "flat_field_numba.py: NameError: name 'imgae' is not defined"),
        ("    out[0] = 'abc' + floor\n", "flat_field_numba.py: line 2: No implementation of"),
        ("  pass\n    pass\n", "unindent|unexpected indent"),
    ],
)
def test_a_function_that_does_not_compile_is_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, message: str
) -> None:
    package = tmp_path / "careless"
    package.mkdir()
    (package / "__init__.py").touch()
    head = "def flat_field(image, flat, dark, drift, out, floor, first, last):\n"
    (package / "flat_field_numba.py").write_text(head + body)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "modules", dict(sys.modules))
    node = replace(find_node("flat_field"), kernel_package="careless", fixed=())
    with pytest.raises(NodeError, match=message) as caught:
        Compiled(node)
    assert "\n" not in str(caught.value)


def test_a_size_that_the_node_does_not_have_is_refused() -> None:
    node = find_node("flat_field")
    with pytest.raises(TypeError, match=r"flat_field: Z is none of its sizes: \('K', 'H', 'W'\)"):
        replace(node).numba(rows="Z")


def test_a_graph_runs_on_it(toys: list[str], write: Write) -> None:
    text = STREAM.replace("prefer: [opencl, numpy]", "prefer: [numba, numpy]")
    pipeline = load(write(text), strict=True)
    assert {p.backend for p in pipeline.plan.placements.values()} == {"numba", "numpy"}
    assert [float(result["light"].mean()) for result in pipeline.items()] == [1, 2, 3]


def test_numba_that_was_demanded_and_is_not_there_is_an_error(
    toys: list[str], write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(backends.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="--backend numba: numba is not installed"):
        load(write(STREAM), backend="numba")


def test_where_nothing_can_be_kept_on_disk_it_is_compiled_and_said(
    toys: list[str], write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    njit = numba.numba.njit

    def no_place(*args: object, cache: bool = False, **options: object) -> object:
        if cache:
            raise RuntimeError("cannot cache function 'flat_field': no locator available")
        return njit(*args, **options)

    monkeypatch.setattr(numba.numba, "njit", no_place)
    pipeline = load(write(STREAM), backend="numba")
    assert "flat_field is compiled at every start" in next(pipeline.items()).warnings[0]


def test_a_run_that_places_nothing_there_does_not_load_numba() -> None:
    code = (
        "import sys; from tactograph.graph import load\n"
        "load('reconstruct', calibration='cal.npz', backend='numpy')\n"
        "print('numba' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
