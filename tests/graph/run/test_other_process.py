"""A pipeline in another process: a fork has no device, a copy is loaded again."""

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest

from tactograph.graph import load
from tactograph.graph.run.pipeline import Pipeline
from tests.fixtures import python
from tests.graph.conftest import SLOPES, Write

HEIGHT = np.sin(np.linspace(0, 3, 24 * 32, dtype=np.float32)).reshape(24, 32)
FORK = """
import os
import sys

import numpy as np

from tactograph import load
from tactograph.graph import InputError

height = np.zeros((24, 32), np.float32)
opened = load(sys.argv[1], backend="opencl")
opened(height=height)
if os.fork() == 0:
    for use in (lambda: opened(height=height), lambda: load(sys.argv[1], backend="opencl")):
        try:
            use()
        except InputError as error:
            os.write(1, f"{error}\\n".encode())
    load(sys.argv[1], backend="numpy")(height=height)
    os.write(1, b"numpy works\\n")
    os._exit(0)
os.wait()
"""


def test_a_fork_says_that_it_has_no_device(write: Write) -> None:
    """Otherwise its first call would wait for threads of the runtime that a fork does not copy."""
    opened, loaded, last = python("-c", FORK, write(SLOPES)).stdout.splitlines()
    for line in (opened, loaded):
        assert "OpenCL was used before this process was forked" in line
        assert "spawn" in line
    assert last == "numpy works"


@pytest.mark.parametrize("again", [copy.deepcopy, lambda p: pickle.loads(pickle.dumps(p))])
def test_a_copy_is_loaded_anew_with_the_settings_as_they_are(
    write: Write, again: Callable[[Pipeline], Pipeline], backend: str
) -> None:
    pipeline = load(write(SLOPES), backend=backend)
    before = pipeline(height=HEIGHT)["height"]
    pipeline.set("pixel", mm=0.2)
    copied = again(pipeline)
    np.testing.assert_array_equal(
        copied(height=HEIGHT)["height"], pipeline(height=HEIGHT)["height"]
    )
    copied.set("pixel", mm=0.1)
    assert copied.plan.graph is not pipeline.plan.graph
    np.testing.assert_array_equal(copied(height=HEIGHT)["height"], before)
