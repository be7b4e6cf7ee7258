"""The core names no ring; a ring imports only the sdk, as an outside package would."""

import ast
import warnings
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from tactograph.graph import rings as engine
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.files.graph_places import shipped
from tactograph.graph.files.layer import read_layer
from tactograph.graph.files.read_graph import read_graph, shipped_names
from tactograph.graph.rings import Ring, bring, rings
from tactograph.sdk import sources
from tests.fixtures import ROOT, needs_rings
from tests.sources import tree

SHIPPED = sorted(folder.parent.name for folder in (ROOT / "rings").glob("*/__init__.py"))
BUILDS_ON = {
    "batch": ("export",),
    "curved_film": ("shapes",),
    "live": ("frames", "oneshot"),
    "mechanics": ("batch", "export", "frames"),
    "metrology": ("export",),
    "oneshot": ("recheck",),
    "recording": ("frames", "export"),
}
"""A ring may import another one, as a package imports those on which it depends."""
MAX_PROMISED = 89
"""Names that one page can explain, and a version can keep stable."""
CORE = ("graph", "nodes", "kernels", "pipelines", "tactograph")


def imported(file: Path) -> Iterator[str]:
    for each in ast.walk(tree(file)):
        if isinstance(each, ast.ImportFrom) and each.module:
            yield each.module
        elif isinstance(each, ast.Import):
            yield from (name.name for name in each.names)


def product(folder: Path) -> Iterator[Path]:
    return (file for file in folder.rglob("*.py") if "tests" not in file.parts)


def test_no_file_of_the_core_imports_a_ring() -> None:
    imports = [
        (file, name)
        for folder in CORE
        for file in product(ROOT / folder)
        for name in imported(file)
        if name.startswith("tactograph.rings")
    ]
    assert imports == []


@pytest.mark.parametrize("name", SHIPPED)
def test_a_ring_imports_the_sdk_and_itself(name: str) -> None:
    allowed = [f"tactograph.rings.{each}" for each in (name, *BUILDS_ON.get(name, ()))]
    allowed.append("tactograph.sdk")
    imports = [
        (file, module)
        for file in product(ROOT / "rings" / name)
        for module in imported(file)
        if module.partition(".")[0] == "tactograph"
        and module != "tactograph"
        and not any(f"{module}.".startswith(f"{each}.") for each in allowed)
    ]
    assert imports == []


def test_every_name_of_the_sdk_exists_and_is_on_its_page() -> None:
    import tactograph.sdk

    page = (ROOT / "docs" / "sdk.md").read_text()
    assert [name for name in sources() if not hasattr(tactograph.sdk, name)] == []
    assert [name for name in sources() if f"`{name}`" not in page] == []


@needs_rings
def test_every_name_of_the_sdk_is_used_by_a_ring_or_a_template() -> None:
    files = [*product(ROOT / "rings"), *(ROOT / "graph/declare/templates").iterdir()]
    text = "\n".join(file.read_text() for file in files)
    named = {name for name in sources() if f"{name}" in text}
    assert {*sources()} - named <= {"SizeRule"}
    assert len(sources()) <= MAX_PROMISED


@pytest.fixture
def register(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[object]:
    """Register packages in a folder as rings, in place of the installed ones."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def add(*named: str) -> tuple[Ring, ...]:
        points = [EntryPoint(*named, engine.ENTRY_POINT_GROUP)] if named else []
        monkeypatch.setattr(engine, "entry_points", lambda group: points)
        engine._rings.cache_clear()
        return rings()

    yield add
    engine._rings.cache_clear()


def test_a_ring_whose_package_is_missing_is_named_and_the_others_work(register: object) -> None:
    assert callable(register)
    with pytest.warns(UserWarning, match="ring 'baize' of baize: there is no package baize"):
        assert [ring.name for ring in register("baize", "baize")] == ["core"]


def test_without_rings_every_graph_of_the_core_has_all_its_nodes(register: object) -> None:
    assert callable(register)
    assert [ring.name for ring in register()] == ["core"]
    overlays = [read_layer(file).model.patch for file in shipped("overlays").values()]
    ops = {change.op for patch in overlays for change in patch if change.op}
    ops |= {entry.op for name in shipped_names() for entry in read_graph(name).nodes.values()}
    modules = {find_node(op).function.__module__ for op in ops}
    assert {each for each in modules if not each.startswith("tactograph.nodes.")} == set()


def test_a_ring_adds_variants_to_a_graph_of_the_core(register: object, tmp_path: Path) -> None:
    assert callable(register)
    (tmp_path / "tweed" / "pipelines" / "variants").mkdir(parents=True)
    text = "format: 1\nbase: paper\nvariants: {tweed: {patch: [{neutral: shadow}]}}\n"
    (tmp_path / "tweed" / "pipelines" / "variants" / "paper.yaml").write_text(text)
    register("tweed", "tweed")
    tweed = read_graph("paper_tweed")
    assert tweed.hash == read_graph("paper_no_shadow").hash
    assert "paper_tweed" in shipped_names()


def test_a_module_of_a_ring_is_imported_only_when_it_is_named(
    register: object, tmp_path: Path
) -> None:
    assert callable(register)
    for file, text in (("__init__.py", "raise SystemExit"), ("formats/fuz.py", "LEVEL = 3")):
        (tmp_path / "fuzz" / file).parent.mkdir(exist_ok=True)
        (tmp_path / "fuzz" / file).write_text(text if "fuz" in file else "")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert [ring.name for ring in register("fuzz", "fuzz")] == ["core", "fuzz"]
    module = bring("formats", "fuz")
    assert module is not None
    assert module.LEVEL == 3
    assert bring("formats", "wool") is None
