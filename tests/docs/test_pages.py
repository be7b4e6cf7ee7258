"""Every command and code block of the documentation works.

Blocks marked sh, python and yaml are run, page by page, each page in a folder of its own.
Commands in other blocks are examples that need a sensor or hours: of them the graphs, parameters,
options and scripts must be there.
"""

import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import venv
import zipfile
from collections.abc import Iterator
from contextlib import redirect_stdout, suppress
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
import pytest
from markdown_it import MarkdownIt

from tactograph.graph.command import COMMANDS, run_command
from tactograph.graph.disk.strict_yaml import Document
from tactograph.graph.files.read_graph import read_graph, shipped_names
from tactograph.graph.rings import brought
from tests.each import each
from tests.fixtures import ROOT, Calibration, MadeOnce, needs_rings, python

PAGES = sorted([*(ROOT / "docs").glob("*.md"), *ROOT.glob("rings/*/docs/*.md")])
RUN = ("sh", "python", "yaml")
TITLE = re.compile(r'title="([^"]+)"')
SHELL = re.compile(r"[|&;<>$*`~#]")
"""Characters that a shell interprets; a pattern in quotes goes to it too."""
SENSOR = """\
tactograph run simulate_flat out=flat seed=2 --quiet
tactograph run simulate out=ball radius_mm=7 seed=1 --quiet
tactograph run calibrate capture=ball flat=flat ball_radius_mm=7 pixel_size_mm=0.0714286 out=cal.npz --quiet
"""  # noqa: E501
"""Commands that several pages begin with; they run once for all `LONG` ones, by the wheel.

Others go on with the calibration of a rig that many tests share.
"""
MADE = [line.removesuffix(" --quiet") for line in SENSOR.splitlines()]


class Block(NamedTuple):
    """A fenced block: its language, the rest of that line, its text, and its place."""

    language: str
    info: str
    text: str
    where: str


def blocks(page: Path) -> Iterator[Block]:
    for token in MarkdownIt().parse(page.read_text(encoding="utf-8")):
        if token.type == "fence" and token.map:
            language, _, info = token.info.partition(" ")
            yield Block(language, info, token.content, f"{page.name}:{token.map[0] + 1}")


LONG = (
    "batch.md",
    "calibrate.md",
    "captures.md",
    "compose.md",
    "contact.md",
    "export.md",
    "filters.md",
    "force.md",
    "graph_files.md",
    "index.md",
    "new_kernel.md",
    "python.md",
    "sensors.md",
    "simulate.md",
    "trust.md",
    "variants.md",
    "without_ball.md",
)
"""Pages that calibrate anew or start many processes, or need packages of 'make test-all'."""
OF_RINGS = ("calibrate.md", "compose.md", "graph_files.md")
"""Pages of `docs` whose examples are graphs of rings."""
RUNNABLE = [page for page in PAGES if any(b.language in RUN for b in blocks(page))]
COMMAND_LINES = [
    (block.where, line)
    for page in [*PAGES, ROOT / "README.md"]
    for block in blocks(page)
    if block.language in ("", "text")
    for line in block.text.splitlines()
]


@pytest.fixture
def wheel(made_once: MadeOnce) -> Path:
    """The Python of an environment into which the wheel is installed, and nothing else."""

    def install(folder: Path) -> None:
        pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
        build = ["wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", str(folder / "dist")]
        source = folder / "source"
        excluded = (".*", "tests", "docs", "build", "demo", "out", "*.egg-info")
        ignored = shutil.ignore_patterns(*excluded)
        shutil.copytree(ROOT, source, ignore=ignored, symlinks=True)
        subprocess.run([*pip, *build, str(source)], check=True)
        (built,) = (folder / "dist").glob("tactograph-*.whl")
        venv.create(folder / "venv", with_pip=False)
        python = folder / "venv" / "bin" / "python"
        into = ["--python", str(python), "install", "--no-deps", "--no-index", str(built)]
        subprocess.run([*pip, *into], check=True)

    return made_once("wheel", install) / "venv" / "bin" / "python"


@pytest.fixture
def sensor(wheel: Path, made_once: MadeOnce) -> Path:
    """A folder with what `SENSOR` writes."""

    def make(folder: Path) -> None:
        folder.mkdir()
        _run_shell(SENSOR, "the commands that pages begin with", folder, installed(wheel))

    return made_once("sensor", make)


def installed(python: Path) -> dict[str, str]:
    """The environment in which `tactograph` is that of the wheel, with dependencies from here."""
    path = f"{python.parent}{os.pathsep}{os.environ['PATH']}"
    return {**os.environ, "PYTHONPATH": str(Path(np.__file__).parents[1]), "PATH": path}


def test_the_wheel_holds_one_package_with_all_its_files(wheel: Path) -> None:
    (built,) = (wheel.parents[2] / "dist").glob("*.whl")
    names = {name for name in zipfile.ZipFile(built).namelist() if ".dist-info/" not in name}
    assert {name.partition("/")[0] for name in names} == {"tactograph"}
    for folder in ("graph", "kernels", "nodes", "pipelines", "rings"):
        files = [
            f
            for f in (ROOT / folder).rglob("*.*")
            if f.suffix not in (".pyc", ".toml") and not {"tests", "docs"} & {*f.parts}
        ]
        missing = {f"tactograph/{file.relative_to(ROOT)}" for file in files} - names
        assert not missing


def test_the_repository_hides_nothing_of_an_installed_wheel(wheel: Path) -> None:
    """Python looks in the working folder first, and finds the package's own folder there."""
    ask = [str(wheel), "-c", "import tactograph.graph.errors, tactograph.nodes"]
    subprocess.run(ask, cwd=ROOT, env=installed(wheel), check=True)


@pytest.mark.slow
def test_a_users_script_is_type_checked(wheel: Path, tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text("from tactograph import load\nload('reconstruct', strict='yes')\n")
    mypy = [sys.executable, "-m", "mypy", "--python-executable", str(wheel), str(script)]
    done = subprocess.run(mypy, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert 'Argument "strict" to "load" has incompatible type' in done.stdout
    assert "Found 1 error" in done.stdout


def marks_of(page: Path) -> list[pytest.MarkDecorator]:
    slow = [pytest.mark.slow] if page.name in LONG else []
    return [*slow, needs_rings] if page.name in OF_RINGS else slow


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=marks_of(page)) for page in RUNNABLE],
    ids=lambda page: page.name,
)
def test_the_examples_of_a_page_run(
    page: Path,
    tmp_path: Path,
    calibration: Calibration,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
) -> None:
    monkeypatch.chdir(tmp_path)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment, run = {**os.environ, "PATH": path}, _run
    is_tour = page.name == "index.md"
    if is_tour:
        # The tour uses the wheel that a user installs; only its dependencies come from here.
        environment, run = installed(request.getfixturevalue("wheel")), _run_shell
    names: dict[str, Any] = {"__name__": "__main__"}
    for block in blocks(page):
        if block.language == "sh" and (is_tour or block.text.startswith(SENSOR)):
            if page.name in LONG:
                shutil.copytree(request.getfixturevalue("sensor"), tmp_path, dirs_exist_ok=True)
            else:
                shutil.copy(calibration("far28"), tmp_path / "cal.npz")
            lines = block.text.splitlines()
            left = [line for line in lines if line.removesuffix(" --quiet") not in MADE]
            run("\n".join(left), block.where, tmp_path, environment)
        elif block.language == "sh":
            run(block.text, block.where, tmp_path, environment)
        elif block.language == "python":
            exec(compile(block.text, block.where, "exec"), names)
        elif block.language == "yaml":
            title = TITLE.search(block.info)
            assert title, f"{block.where}: a graph file needs a title"
            (tmp_path / title[1]).write_text(block.text)
            assert Document.read(tmp_path / title[1]).data["format"] == 1


def _run(text: str, where: str, folder: Path, environment: dict[str, str]) -> None:
    """Run line by line; a plain command of tactograph runs in this process.

    Starting a process takes longer than most of them.  The page index.md shows that one starts.
    """
    lines = [line for line in text.splitlines() if line]
    plain = [line.startswith("tactograph ") and not SHELL.search(line) for line in lines]
    if not any(plain) or "<<" in text or '="' in text:
        _run_shell(text, where, folder, environment)
        return
    for line, is_plain in zip(lines, plain, strict=True):
        if is_plain:
            run_command(shlex.split(line)[1:])
        else:
            _run_shell(line, where, folder, environment)


def _run_shell(text: str, where: str, folder: Path, environment: dict[str, str]) -> None:
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", text],
        cwd=folder, env=environment,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{where}\n{text}\n{done.stdout}\n{done.stderr}"


@needs_rings
@each("where, line", [(w, line) for w, line in COMMAND_LINES if line.startswith("tactograph ")])
def test_a_command_that_is_only_shown_exists(
    where: str, line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = shlex.split(line.partition("  #")[0].split("|")[0])[1:]
    assert words[0] in [*COMMANDS, *brought("verbs")], where
    run_command([words[0], "--help"])
    _check_options(where, capsys.readouterr().out, words)
    graphs = [word for word in words[1:] if word in names_that_ship()]
    params = {name for graph in graphs for name in params_of(graph)}
    for word in words[1:]:
        name, equals, _ = word.partition("=")
        if graphs and equals and name.isidentifier():
            assert name in params, f"{where}: {line}: no graph takes {name}"


@cache
def names_that_ship() -> frozenset[str]:
    return frozenset(shipped_names())


@cache
def params_of(graph: str) -> frozenset[str]:
    return frozenset(read_graph(graph).params)


@needs_rings
@each("where, line", [(w, line) for w, line in COMMAND_LINES if line.startswith("python ")])
def test_a_script_that_is_only_shown_exists(where: str, line: str) -> None:
    words = shlex.split(line.partition("  #")[0])[1:]
    script = next(word for word in words if word.endswith(".py"))
    assert (ROOT / script).is_file(), f"{where}: {line}"
    if words[0].startswith("benchmarks/") and any(word.startswith("--") for word in words):
        _check_options(where, help_of(script), words)


@cache
def help_of(script: str) -> str:
    """The help text of a script, which runs in this process as that has its imports already."""
    words, folders = [script, "--help"], [str((ROOT / script).parent), *sys.path]
    with (
        patch.object(sys, "argv", words), patch.object(sys, "path", folders),
        redirect_stdout(StringIO()) as shown, suppress(SystemExit),
    ):  # fmt: skip
        runpy.run_path(str(ROOT / script), run_name="__main__")
    return shown.getvalue()


def _check_options(where: str, help_text: str, words: list[str]) -> None:
    for option in (word.partition("=")[0] for word in words if word.startswith("--")):
        assert option in help_text, f"{where}: {option}"


@pytest.mark.slow
def test_the_site_builds_without_a_broken_link(tmp_path: Path) -> None:
    python("-m", "mkdocs", "build", "--strict", "--quiet", "-d", tmp_path, cwd=ROOT)
    assert (tmp_path / "nodes" / "flat_field" / "index.html").is_file()
