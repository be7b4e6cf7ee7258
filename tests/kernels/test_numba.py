"""Every node with a function for the host's compiler gives the same as in NumPy."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from tactograph.graph.backends import numba
from tactograph.graph.backends.numba import Compiled
from tactograph.graph.declare.find_node import builtin_names, find_node
from tactograph.graph.declare.node import Node
from tactograph.graph.declare.parity import Case, cases, compare

NODES = [name for name in builtin_names() if "numba" in find_node(name).backends]
UNROLLED = [name for name in NODES if find_node(name).fixed]
CASES = [(name, case) for name in NODES for case in cases(find_node(name))]
MUTANTS = {
    "flat_field": {
        "dark not subtracted": (" - dark[row, column])", ")"),
        "floor ignored": ("larger(floor, flat[k, row, column])", "flat[k, row, column]"),
        "light of the first LED for all": ("(image[k,", "(image[0,"),
        "drift forgotten": ("if drift.size", "if False"),
        "the last row left out": ("range(first, last)", "range(first, last - 1)"),
    },
    "light_noise": {
        "shot and read swapped": ("noise[0], noise[1]", "noise[1], noise[0]"),
        "variance instead of its root": ("np.sqrt(variance)", "variance"),
        "floor ignored": ("larger(floor, flat[k, row, column])", "flat[k, row, column]"),
    },
    "pixel_mean_slope": {
        "left not one-sided": ("share[0] = share[W - 1] = ONE", "share[W - 1] = ONE"),
        "top not one-sided": ("HALF if below - above == 2 else ONE", "HALF"),
        "along the row alone": ("add_p = down[2] * (down[0] + p * down[2]) + ", "add_p = "),
        "no limit": ("limit, by = most * square", "limit, by = ONE * square"),
        "the row above twice": (
            "normals[below % 3],\n            HALF",
            "normals[above % 3],\n            HALF",
        ),
    },
    "label_lights": {
        "noise floor ignored": ("< floor * spread", "< ZERO * spread"),
        "shadows are free": ("cost = misfit + least", "cost = misfit"),
        "a shadow may be bright": ("+ least + excess", "+ least"),
        "a weight forgotten": (
            "misfit += lit[k] * pixels.weight[k, i]",
            "misfit += lit[k] * pixels.weight[0, i]",
        ),
        "no step": ("STEPS = 1", "STEPS = 0"),
        "lights weigh alike": (
            "lit[k] * pixels.weight[k, i])\n",
            "lit[k] * pixels.weight[0, i])\n",
        ),
        "the steeper of a pair": (
            "flatter = first[2] >= second[2]",
            "flatter = first[2] < second[2]",
        ),
        "attached and prior swapped": ("take = darker if pair", "take = darker if not pair"),
        "height ignored": ("ly - y, lz - z", "ly - y, lz"),
        "lights from the corner": ("F4(column) - HALF * F4(W - 1)", "F4(column)"),
        "a set that is closed wins": ("better = open_ & (cost", "better = (cost"),
        "variances swapped": (
            "return by_p if known else UNKNOWN, by_q",
            "return by_q if known else UNKNOWN, by_p",
        ),
        "unknown pixels not dark": ("return dim if used else forced", "return dim"),
        "every pixel is done at once": ("pixels.cost[i] > price * F4(number):", "False:"),
        "columns lost on the way": ("at = int(pixels.column[i])", "at = i"),
    },
}
LISTED = [(name, what) for name, mutants in MUTANTS.items() for what in mutants]


@pytest.mark.parametrize(("name", "case"), CASES, ids=[f"{n}-{c}" for n, c in CASES])
def test_both_back_ends_agree(name: str, case: Case) -> None:
    assert compare(find_node(name), compiled(name), case) is None


@pytest.mark.parametrize("lights", [3, 8])
@pytest.mark.parametrize("name", UNROLLED)
def test_any_number_of_lights(name: str, lights: int) -> None:
    node = find_node(name)
    for case in cases(node, shapes=((33, 147),)):
        other = replace(case, sizes={**case.sizes, "K": lights})
        assert compare(node, compiled(name), other) is None, str(other)


@pytest.mark.parametrize("name", NODES)
def test_threads_share_an_image_without_a_seam(name: str) -> None:
    node = find_node(name)
    for case in cases(node, shapes=((150, 400),))[:2]:
        assert compare(node, compiled(name), case) is None, str(case)


@pytest.mark.parametrize(("name", "what"), LISTED, ids=[f"{n}: {w}" for n, w in LISTED])
def test_parity_catches(name: str, what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before, after = MUTANTS[name][what]
    assert before in source(name), "the mutant no longer fits the function"
    other = as_plain_python(name, source(name).replace(before, after), monkeypatch)
    assert any(compare(other.node, other, case) for case in few(name))


@pytest.mark.parametrize("name", NODES)
def test_it_is_the_mutation_that_parity_catches(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    other = as_plain_python(name, source(name), monkeypatch)
    for case in few(name):
        assert compare(other.node, other, case) is None, str(case)


@pytest.mark.parametrize("name", NODES)
def test_what_is_kept_on_disk_is_as_new_as_its_file(name: str) -> None:
    """It is compiled anew when its own file changes, not when another does."""
    lines = [line for line in source(name).splitlines() if re.match(r"\s*(from|import) ", line)]
    assert set(lines) <= {
        "from __future__ import annotations",
        "from collections.abc import Callable",
        "from typing import Any, NamedTuple",
        "import numpy as np",
        "from tactograph.graph.backends.numba import inlined",
    }


def test_every_function_has_mutants() -> None:
    assert set(NODES) == set(MUTANTS)


@cache
def compiled(name: str) -> Compiled:
    return Compiled(find_node(name))


def source(name: str) -> str:
    module = importlib.import_module(f"{find_node(name).kernel_package}.{name}_numba")
    return Path(str(module.__file__)).read_text(encoding="utf-8")


def few(name: str) -> list[Case]:
    return cases(find_node(name), shapes=((3, 5), (7, 9)))


def as_plain_python(name: str, text: str, monkeypatch: pytest.MonkeyPatch) -> Compiled:
    """The function without the compiler, which would take long for every mutant."""
    monkeypatch.setattr(numba, "inlined", lambda function: function)
    module = ModuleType(name)
    exec(text, vars(module))

    def found(node: Node, fixed: tuple[int, ...]) -> Callable[..., None]:
        function: Any = getattr(module, node.name)
        return np.errstate(all="ignore")(function(*fixed) if fixed else function)

    monkeypatch.setattr(numba, "_compiled", found)
    return Compiled(find_node(name))
