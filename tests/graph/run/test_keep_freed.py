"""The system provides the memory of a node's arrays once, not for every array."""

import platform

import pytest

from tests.fixtures import python

CHAIN = """
import resource
import numpy as np

def chain():
    arrays = [np.ones(100_000) for _ in range(8)]

{keep}
chain()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(10):
    chain()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""
KEEP = "from tactograph.graph.run.keep_freed import keep_freed; keep_freed()"


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries take no note")
def test_memory_freed_by_a_node_is_reused() -> None:
    without, kept = (int(python("-c", CHAIN.format(keep=keep)).stdout) for keep in ("", KEEP))
    assert kept < 100 < without
