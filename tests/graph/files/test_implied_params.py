"""A `$name` that feeds a node's parameter `name` becomes a param, as the node describes it."""

from typing import Any

import pytest

from tactograph.graph import GraphError
from tactograph.graph.files.flat_graph import Graph, Param
from tactograph.graph.files.read_graph import read_graph


def graph_of(params: dict[str, Any] | None = None, **settings: dict[str, str]) -> Graph:
    """A graph of sources, each of the op before the first double underscore of its name."""
    nodes = {name: {"op": name.partition("__")[0], "with": s} for name, s in settings.items()}
    return read_graph({"format": 1, "params": params or {}, "nodes": nodes})


def test_an_implied_param_takes_kind_default_and_help_from_the_node() -> None:
    graph = graph_of(
        light_ring={"slant_deg": "$slant_deg"},
        read_capture={
            "folder": "$folder",
            "crop": "$crop",
            "single": "$single",
            "channel": "$channel",
        },
    )
    slant = graph.params["slant_deg"]
    assert (slant.kind, slant.required, slant.default) == ("number", False, 28.0)
    assert slant.help.startswith("angle between")
    folder = graph.params["folder"]
    assert (folder.kind, folder.required, folder.default) == ("path", True, None)
    kinds = {name: param.kind for name, param in graph.params.items()}
    assert (kinds["crop"], kinds["single"], kinds["channel"]) == ("numbers", "flag", "text")


def test_a_param_that_the_graph_states_takes_precedence() -> None:
    stated = {"slant_deg": {"kind": "number", "default": 3.0, "help": "mine"}}
    graph = graph_of(stated, light_ring={"slant_deg": "$slant_deg"})
    assert graph.params == {"slant_deg": Param("number", "mine", False, 3.0)}


def test_a_param_of_another_name_has_to_be_stated() -> None:
    assert not graph_of(light_ring={"slant_deg": "$slant"}).params


def test_nodes_that_disagree_on_an_implied_param_are_refused() -> None:
    message = "with.seed: 'seed' is integer, optional, for expose_film, but integer, default 0"
    with pytest.raises(GraphError, match=message):
        graph_of(draw_touches={"seed": "$seed"}, expose_film={"seed": "$seed"})
