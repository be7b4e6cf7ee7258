"""A new node works from the start, in the project or in a separate package."""

from pathlib import Path

import pytest

from tests.fixtures import ROOT, python
from tests.graph.conftest import Command, one_line


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for part in ("graph", "nodes/light", "kernels/light", "pipelines", "tests/nodes"):
        (tmp_path / part).mkdir(parents=True)
    (tmp_path / "nodes" / "light" / "__init__.py").touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_in_a_clone_a_node_is_four_files(tactograph: Command, clone: Path) -> None:
    before = {*clone.rglob("*")}
    outcome = tactograph("new-node", "light/brighten")
    assert outcome.code == 0
    written = {str(f.relative_to(clone)) for f in clone.rglob("*") if f.is_file()} - {
        str(f.relative_to(clone)) for f in before
    }
    assert written == {
        "nodes/light/brighten.py",
        "kernels/light/brighten.cl",
        "kernels/light/brighten.mutants.toml",
        "tests/nodes/light/test_brighten.py",
    }


@pytest.mark.parametrize("check", [["check"], ["format", "--check", "--diff"]])
@pytest.mark.parametrize("ring", [False, True])
def test_the_written_files_are_formatted_and_pass_the_linter(
    tactograph: Command, clone: Path, ring: bool, check: list[str]
) -> None:
    assert (
        tactograph(*(["new-ring", "my-felt"] if ring else ["new-node", "light/brighten"])).code == 0
    )
    config = ["--config", str(ROOT / "pyproject.toml")]
    if ring:
        # From another package, tactograph is a third-party package.
        config = ["--isolated", "--line-length", "100"]
        config += ["--select", "E,F,I,UP"] if check == ["check"] else []
    python("-m", "ruff", *check, *config, ".", cwd=clone / "my-felt" if ring else clone)


@pytest.mark.slow
def test_a_new_ring_passes_its_own_tests_once_installed(
    tactograph: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert tactograph("new-ring", "my-felt").code == 0
    assert tactograph("new-node", "darken", "--ring", "my-felt/my_felt").code == 0
    site = tmp_path / "site"
    install = ["pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    python("-m", *install, "--target", site, "./my-felt")
    # Away from the sources, so that the installed files are what is tested.
    tests = ("-m", "pytest", "-q", "--rootdir", "my-felt", "my-felt")
    done = python(*tests, PYTHONPATH=site)
    assert "9 passed" in done.stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["brighten"], "write ROOM/brighten; rooms are light"),
        (["light/flat_field"], "node 'flat_field' exists already"),
        (["light/Flat"], "lower-case"),
        (["light/class"], "a Python keyword"),
        (["light/a-b"], "lower-case"),
    ],
)
def test_an_invalid_name_of_a_node_is_refused(
    tactograph: Command, clone: Path, words: list[str], message: str
) -> None:
    assert message in one_line(tactograph("new-node", *words))
    assert not [f for f in clone.rglob("*") if f.is_file() and f.name != "__init__.py"]


def test_nothing_is_overwritten(tactograph: Command, clone: Path) -> None:
    (clone / "kernels" / "light" / "brighten.cl").write_text("mine")
    assert "nothing was written" in one_line(tactograph("new-node", "light/brighten"))
    assert not (clone / "nodes" / "brighten.py").exists()


def test_outside_a_clone_a_new_node_needs_a_ring(
    tactograph: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert "tactograph new-ring" in one_line(tactograph("new-node", "brighten"))


@pytest.mark.parametrize(
    ("folder", "message"),
    [
        ("1felt", "cannot be a package"),
        ("für", "cannot be a package"),
        ("numpy", "'numpy' is installed already"),
        ("tactograph-core", "'core' is installed already"),
    ],
)
def test_an_invalid_name_of_a_ring_is_refused(
    tactograph: Command, clone: Path, folder: str, message: str
) -> None:
    assert message in one_line(tactograph("new-ring", folder))
    assert not (clone / folder).exists()
