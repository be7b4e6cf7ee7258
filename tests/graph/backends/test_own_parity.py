"""The parity test of a user's own node, in a file of its own, and its report of a wrong kernel."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

TEST = """
import numpy as np
from tactograph.graph import node, parity
from tactograph.graph.backends.device_call import DeviceCall
from tactograph.graph.backends.opencl import open_device
from tactograph.nodes import Light


@node
def astray(light: Light) -> Light:
    return light


astray.opencl(grid="K H W", source='''
#include "common.clh"
__kernel void astray(
    __global const float *restrict light, __global float *restrict out,
    const int K, const int H, const int W)
{{
    GRID_3(k, y, x, K, H, W)
    const long i = (k * H + y) * W + x;
    out[i == 0 ? {beyond} : i] = light[i];
}}
''')


def test_astray() -> None:
    {call}
"""
PARITY = "parity.check(astray)"
CALL = "DeviceCall(astray, open_device()[0])(np.ones((3, 4, 5), np.float32))"


def outcome(folder: Path, beyond: str, call: str = PARITY) -> subprocess.CompletedProcess[str]:
    file = folder / "test_astray.py"
    file.write_text(TEST.format(beyond=beyond, call=call))
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(file)]
    env = {**os.environ, "TACTOGRAPH_WAIT": "1" if call == CALL else "0"}
    return subprocess.run(words, cwd=folder, env=env, capture_output=True, text=True, check=False)


def test_a_kernel_in_the_file_of_the_test_is_compared(tmp_path: Path) -> None:
    done = outcome(tmp_path, "0")
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("call", "name"),
    [
        (PARITY, "the kernel of astray, case K4xH1xW1-random-default"),
        (CALL, "kernel astray(light: 240 bytes, out: 240 bytes, K=3, H=4, W=5)"),
    ],
)
def test_a_kernel_that_ends_the_process_is_named(tmp_path: Path, call: str, name: str) -> None:
    """With its case, or with its arguments where TACTOGRAPH_WAIT asks for it.

    A store terabytes beyond the buffer: no driver forgives it on a CPU.  Another thread of the
    driver may end the process before the report is written to its end.
    """
    all_done = [outcome(tmp_path, "(1L << 40)", call) for _ in range(3)]
    assert all(done.returncode < 0 for done in all_done), "killed by a signal"
    assert any(name in done.stdout + done.stderr for done in all_done)
