"""The compiler gives no warning, as PoCL prints warnings on the user's terminal.

The sources also avoid code that it compiles wrongly without a warning.
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
    """Except for the last one, which is written for this test to show that warnings are noticed."""
    afresh = {"POCL_CACHE_DIR": tmp_path, "PYOPENCL_NO_CACHE": "1"}
    done = python("-W", "ignore", "-c", SCRIPT, **afresh)
    assert done.stderr == "1 warning generated.\n"


NODES = [node for node in map(find_node, shipped_nodes()) if node.has_kernel]
STANDS_ALONE = re.compile(r"^static ONCE [^{;]*\{.*?^\}", re.MULTILINE | re.DOTALL)


def test_functions_that_stand_alone_use_neither_place_nor_local_memory() -> None:
    functions = {text for node in NODES for text in STANDS_ALONE.findall(kernel_source(node))}
    assert len(functions) > 20
    wrong = [text for text in functions if re.search(r"\bget_\w+_(id|size)\b|__local\b", text)]
    assert wrong == []
