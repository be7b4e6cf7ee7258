"""A feature without its package says in one line which extra installs it."""

import re
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tactograph.nodes.files.height_files import write_ply
from tests.fixtures import ROOT, python
from tests.graph.conftest import Command, one_line

CAPTURE = ROOT / "tests" / "data" / "far28" / "sphere"
COMPARE = ["compare", "paper", "--over", CAPTURE, "calibration=cal.npz"]


@pytest.fixture
def hide(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[str], None]:
    """An empty folder to work in; a package hidden by its name is not found."""
    monkeypatch.chdir(tmp_path)
    return lambda package: monkeypatch.setitem(sys.modules, package, None)


@pytest.mark.parametrize(
    ("package", "extra", "words"),
    [
        ("jinja2", "report", COMPARE),
        ("jinja2", "report", ["demo"]),
        ("jinja2", "report", ["new-ring", "mine"]),
    ],
)
def test_a_command_names_the_extra_and_does_nothing(
    tactograph: Command, hide: Callable[[str], None], package: str, extra: str, words: list[str]
) -> None:
    hide(package)
    message = one_line(tactograph(*words))
    assert message.endswith(f"needs {package}: pip install 'tactograph[{extra}]'\n")
    assert not [*Path().iterdir()]


def test_writing_a_mesh_needs_no_extra(hide: Callable[[str], None]) -> None:
    hide("trimesh")
    write_ply(Path("a.ply"), np.zeros((4, 5), np.float32), 0.1)
    assert Path("a.ply").stat().st_size > 100


def test_every_extra_that_a_message_names_exists() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    code = [
        f.read_text() for room in ("graph", "nodes", "rings") for f in (ROOT / room).rglob("*.py")
    ]
    named = {name for text in code for name in re.findall(r"\bneed\(\s*\"([a-z]+)\"", text)}
    assert {"report"} <= named <= {*project["optional-dependencies"]}


def test_every_node_is_read_without_an_extra(tmp_path: Path) -> None:
    script = (
        "import sys\n"
        "extras = 'zarr numcodecs trimesh jinja2 mcap rerun surfalize harvesters nicegui'\n"
        "sys.modules.update(dict.fromkeys(extras.split()))\n"
        "from tactograph.graph.command import run_command\n"
        "run_command(['nodes'])\n"
    )
    assert python("-c", script, cwd=tmp_path).stderr == ""
