"""The compiler has nothing to say: PoCL prints its warnings on the user's terminal.

What it does not say, but gets wrong, the sources keep clear of.
"""

import re
from pathlib import Path

import pytest

from tactograph.graph.backends.kernel_source import kernel_source
from tactograph.graph.declare.find_node import find_node, shipped_nodes
from tests.fixtures import python

SCRIPT = """
import pyopencl as cl
from tactograph.graph.backends.devices import choose_device
from tactograph.graph.backends.kernel_source import kernel_source
from tactograph.graph.declare.find_node import shipped_nodes, find_node

context = cl.Context([choose_device("Portable")[0].handle])
sources = [kernel_source(n) for n in map(find_node, shipped_nodes()) if n.has_kernel]
sources += ["__kernel void unclear(__global int *a) { if (a[0] = 1) a[1] = 2; }"]
for source in sources:
    constants = ["-DLANES=16", "-DGROUP=1", "-DLEDS=4", "-DTALL=4", "-DCOATED=1", "-DITEM_ROWS=4"]
    cl.Program(context, source).compile(["-cl-opt-disable", *constants])
"""


@pytest.mark.slow
def test_no_kernel_compiles_with_a_warning(tmp_path: Path) -> None:
    """But for one that is written for this test, last, so that a warning is known to be seen."""
    afresh = {"POCL_CACHE_DIR": tmp_path, "PYOPENCL_NO_CACHE": "1"}
    done = python("-W", "ignore", "-c", SCRIPT, **afresh)
    assert done.stderr == "1 warning generated.\n"


NODES = [node for node in map(find_node, shipped_nodes()) if node.has_kernel]
STANDS_ALONE = re.compile(r"^static ONCE [^{;]*\{.*?^\}", re.MULTILINE | re.DOTALL)


def test_functions_that_stand_alone_know_neither_place_nor_local_memory() -> None:
    found = {text for node in NODES for text in STANDS_ALONE.findall(kernel_source(node))}
    assert len(found) > 20
    wrong = [text for text in found if re.search(r"\bget_\w+_(id|size)\b|__local\b", text)]
    assert wrong == []
