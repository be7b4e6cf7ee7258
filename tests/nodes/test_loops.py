"""Loops that numba compiles for the host."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tactograph.graph.declare.find_node import find_node
from tactograph.graph.declare.parity import cases, make_inputs

LOOPS = {
    "film_bounce": ["light._sweep_loops"],
}


@pytest.mark.parametrize("name", LOOPS)
def test_a_loop_is_compiled_once_whoever_calls_its_node(name: str) -> None:
    """Numba compiles anew for arrays that are read-only, as those of a graph are; for seconds."""
    node = find_node(name)
    case = cases(node)[0]
    for writeable in (True, False):
        inputs = make_inputs(node, case)
        for array in inputs.values():
            if hasattr(array, "flags"):
                array.flags.writeable = writeable
        node(*node.in_order(inputs), **case.settings)
    for module in LOOPS[name]:
        loops = vars(importlib.import_module(f"tactograph.nodes.{module}"))
        compiled = {
            name: len(loop.signatures)
            for name, loop in loops.items()
            if hasattr(loop, "signatures")
        }
        assert max(compiled.values()) == 1, compiled


UNKEPT = """
import numba
from tactograph.graph.errors import collect_warnings
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.declare.parity import cases, make_inputs

node, notes = find_node("film_bounce"), []
case = cases(node, shapes=((3, 5),))[0]
with collect_warnings(notes):
    node(*node.in_order(make_inputs(node, case)), **case.settings)
print(numba.config.CACHE_DIR)
print(*notes)
"""


def test_loops_are_compiled_where_nothing_can_be_kept() -> None:
    """As in a container whose user owns no folder; numba itself refuses that."""
    environment = {**os.environ, "NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator"}
    environment.pop("NUMBA_CACHE_DIR", None)
    ran = subprocess.run(
        [sys.executable, "-c", UNKEPT], env=environment, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    folder, said = ran.stdout.splitlines()
    assert "set NUMBA_CACHE_DIR to a folder" in said
    assert not Path(folder).exists(), "what was compiled goes with its process"
