"""A changed graph becomes the shortest variant, which reads back as the graph on the screen."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tactograph.graph import InputError
from tactograph.graph.files.flat_graph import Entry, Graph
from tactograph.graph.files.read_graph import read_graph
from tactograph.rings.tune.variant import changes_between, write_variant


def changed(graph: Graph, name: str, **what: Any) -> Graph:
    return graph.with_entry(name, replace(graph.nodes[name], **what))


def test_only_differences_are_written() -> None:
    base = read_graph("paper")
    graph = changed(base, "shadow", settings={"threshold": 4.5})
    graph = changed(graph, "integrate.raw", backend="numpy")
    assert changes_between(base, graph) == [
        {"set": "shadow", "with": {"threshold": 4.5}},
        {"backend": "integrate.raw", "to": "numpy"},
    ]
    same = changed(base, "shadow", settings={"threshold": 3.0})
    assert changes_between(base, same) == []


@pytest.mark.parametrize(
    ("name", "base"), [("paper", "paper"), ("paper_no_shadow", "paper_no_shadow")]
)
def test_a_node_is_taken_out_and_put_back(tmp_path: Path, name: str, base: str) -> None:
    graph = read_graph(base)
    turned = changed(graph, "shadow", neutral=not graph.nodes["shadow"].neutral)
    changes = changes_between(graph, turned)
    assert len(changes) == 1
    saved = write_variant(tmp_path / "v.yaml", name, changes, "turned")
    assert saved.nodes["shadow"].neutral == turned.nodes["shadow"].neutral
    assert saved.nodes["shadow"].inputs == turned.nodes["shadow"].inputs


def test_a_change_to_every_use_is_written_once(tmp_path: Path) -> None:
    base = read_graph("reconstruct")
    graph = base
    for name in base.uses_of("rough_pass"):
        settings = {**base.nodes[f"{name}.label"].settings, "dark": 0}
        graph = changed(graph, f"{name}.label", settings=settings)
    graph = changed(graph, "rough.2.bounce", neutral=True)
    changes = changes_between(base, graph)
    assert changes == [
        {"set": "rough_pass.label", "with": {"dark": 0}},
        {"neutral": "rough.2.bounce"},
    ]
    saved = write_variant(tmp_path / "v.yaml", "reconstruct", changes, "lit")
    assert saved.nodes == graph.nodes
    graph = changed(graph, "rough.3.label", settings={"steepest": 4.0, "dark": 1})
    assert [change.get("set") for change in changes_between(base, graph)][:2] == [
        "rough.1.label",
        "rough.2.label",
    ]


def test_a_variant_extends_a_file_by_its_place(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    file = tmp_path / "mine.yaml"
    file.write_text(
        "format: 1\nextends: paper\npatch:\n  - set: shadow\n    with: {threshold: 5}\n"
    )
    changes = [{"set": "shadow", "with": {"threshold": 6}}]
    saved = write_variant(tmp_path / "deep" / "v.yaml", str(file), changes, "deeper")
    assert saved.nodes["shadow"].settings == {"threshold": 6}
    assert "extends: ../mine.yaml" in (tmp_path / "deep" / "v.yaml").read_text()


def test_changes_that_no_variant_can_hold_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing was changed"):
        write_variant(tmp_path / "v.yaml", "paper", [], "same")
    change = [{"neutral": "shadow"}]
    with pytest.raises(InputError, match=r"has to end in \.yaml"):
        write_variant(tmp_path / "v.txt", "paper", change, "text")


def test_an_entry_without_words_is_put_back_without_words() -> None:
    base = read_graph("paper_no_shadow")
    graph = base.with_entry("shadow", Entry("shadow_linear", base.nodes["shadow"].inputs))
    assert changes_between(base, graph) == [{"replace": "shadow", "op": "shadow_linear"}]
