"""The JSON schema of graph files: correct files pass, a file with a mistake does not."""

import copy
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from tactograph.graph.declare.find_node import shipped_nodes
from tactograph.graph.disk.strict_yaml import Document
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.files.schema import make_schema
from tests.each import each
from tests.graph.conftest import SLOPES


@cache
def validator() -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator(make_schema())


GROUP = {
    "inputs": {"height": {}, "pixel": {"default": "pixel"}, "rest": {"default": None}},
    "params": {"mm": {"default": 0.1, "help": "mm per px"}},
    "nodes": {"size": {"op": "pixel_size", "with": {"mm": "$mm"}}},
    "outputs": {"size": "size"},
}


def slopes() -> dict[str, Any]:
    """The plain data of a small graph, with a group and a use of it."""
    data: dict[str, Any] = Document.parse(SLOPES, "g.yaml").data
    data["groups"] = {"sized": copy.deepcopy(GROUP)}
    data["nodes"]["use"] = {"group": "sized", "in": {"height": "again"}, "with": {"mm": 0.2}}
    return data


SHIPPED = sorted(read_graph("paper").file.parents[1].glob("*/*.yaml"))


@each("file", SHIPPED)
def test_a_shipped_file_names_its_schema_for_editors(file: Path) -> None:
    first = file.read_text().partition("\n")[0]
    assert first == "# yaml-language-server: $schema=../pipeline.schema.json"


@each("file", SHIPPED)
def test_a_shipped_file_passes(file: Path) -> None:
    validator().validate(Document.read(file).data)


Mistake = Callable[[dict[str, Any]], object]


@pytest.mark.parametrize(
    "mistake",
    [
        pytest.param(lambda g: g.pop("format"), id="no format"),
        pytest.param(lambda g: g.update(format=2), id="another format"),
        pytest.param(lambda g: g.update(titel=g.pop("title")), id="a key of the file"),
        pytest.param(lambda g: g["nodes"]["pixel"].update(wiht={}), id="a key of a node"),
        pytest.param(lambda g: g["nodes"]["pixel"].pop("op"), id="no op"),
        pytest.param(lambda g: g["nodes"]["pixel"].update(op=5), id="an op that is no name"),
        pytest.param(lambda g: g["nodes"]["pixel"]["with"].update(nm=1), id="a parameter"),
        pytest.param(lambda g: g["nodes"]["pixel"]["with"].update(mm=0), id="out of range"),
        pytest.param(lambda g: g["nodes"]["pixel"]["with"].update(mm="x"), id="of another type"),
        pytest.param(lambda g: g["nodes"]["slope"]["in"].update(hieght="a"), id="an input"),
        pytest.param(lambda g: g["nodes"]["slope"]["in"].update(height="a..b"), id="a reference"),
        pytest.param(lambda g: g["nodes"]["slope"].update(backend="gpu"), id="a back end"),
        pytest.param(lambda g: g["params"]["file"].update(kind="file"), id="the kind of a param"),
        pytest.param(lambda g: g.update(prefer=["cuda"]), id="a preference"),
        pytest.param(lambda g: g.update(patch=[{"sett": "a"}]), id="a verb"),
        pytest.param(lambda g: g["groups"]["sized"].pop("nodes"), id="a group without nodes"),
        pytest.param(lambda g: g["groups"]["sized"].update(input={}), id="a key of a group"),
        pytest.param(
            lambda g: g["groups"]["sized"]["inputs"].update(a={"of": 1}), id="an input of a group"
        ),
        pytest.param(
            lambda g: g["groups"]["sized"]["nodes"]["size"]["with"].update(mm=0),
            id="out of range in a group",
        ),
        pytest.param(lambda g: g["nodes"]["use"].update(op="pixel_size"), id="op and group"),
        pytest.param(lambda g: g["nodes"]["use"].update(neutral=True), id="a key of a use"),
    ],
)
def test_a_mistake_does_not_pass(mistake: Mistake) -> None:
    graph = slopes()
    mistake(graph)
    with pytest.raises(jsonschema.ValidationError):
        validator().validate(graph)


def test_a_small_graph_passes_with_its_params_groups_and_nodes_of_other_packages() -> None:
    graph = slopes()
    validator().validate(graph)
    graph["nodes"]["pixel"]["with"]["mm"] = "$mm"
    graph["nodes"]["other"] = {"op": "acme_scale", "with": {"by": 4}, "in": {"light": "height"}}
    validator().validate(graph)


def test_every_built_in_node_is_in_the_schema() -> None:
    shared = make_schema()["$defs"]
    assert shared["op"]["anyOf"][0]["enum"] == shipped_nodes()
    assert len(shared["by_op"]["allOf"]) == len(shipped_nodes())


def changed(**change: Any) -> dict[str, Any]:
    return {"format": 1, "extends": "paper", "patch": [change]}


SIZE = {"op": "pixel_size", "with": {"mm": 0.1}}


@pytest.mark.parametrize(
    "change",
    [
        {"set": "take.pixel", "with": {"mm": 0.2}, "in": {"stated": None}},
        {"set": "rounds", "with": {"anything": 1}},
        {"insert": "size", **SIZE, "after": "cal.pixel_size"},
        {"replace": "size", "op": "acme_scale", "with": {"by": 4}},
        {"insert": "rounds", "group": "round", "repeat": 3, "carry": {"a": "b"}},
        {"remove": "save"},
        {"backend": "save", "to": "numpy"},
    ],
)
def test_a_correct_change_passes(change: dict[str, Any]) -> None:
    validator().validate(changed(**change))


@pytest.mark.parametrize(
    "change",
    [
        pytest.param({"insert": "size", **SIZE, "with": {"nm": 1}}, id="a parameter"),
        pytest.param({"replace": "size", **SIZE, "with": {"mm": 0}}, id="out of range"),
        pytest.param(
            {"insert": "a", "op": "write_result", "with": {}}, id="no folder, which is needed"
        ),
        pytest.param({"insert": "size", **SIZE, "in": {"hieght": "a"}}, id="an input"),
        pytest.param({"insert": "size", **SIZE, "in": {"height": None}}, id="an input taken away"),
        pytest.param({"insert": "size", **SIZE, "group": "round"}, id="op and group"),
        pytest.param({"insert": "size", "with": {"mm": 1}}, id="neither op nor group"),
        pytest.param({"set": "size", **SIZE}, id="an op that is set"),
        pytest.param({"set": "size", "remove": "save"}, id="two verbs"),
        pytest.param({"op": "pixel_size", "with": {"mm": 0.1}}, id="no verb"),
        pytest.param({"backend": "save"}, id="no back end"),
    ],
)
def test_a_wrong_change_does_not_pass(change: dict[str, Any]) -> None:
    with pytest.raises(jsonschema.ValidationError):
        validator().validate(changed(**change))
