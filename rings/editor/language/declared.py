"""What a node or a group takes and makes, with the words that its page has of each."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from tactograph.rings.editor.language.cursor import mapping
from tactograph.sdk import Graph, node_page, nodes

_PAGE_SECTION = re.compile(r"^## (\w+)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
_PAGE_ITEM = re.compile(r"^- `(\w+)` (.*)$", re.MULTILINE)


@dataclass(frozen=True)
class Declared:
    """Inputs, params and outputs by name, each with a line on its type, range and meaning."""

    summary: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)
    params: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)
    choices: Mapping[str, list[Any]] = field(default_factory=dict)


NO_DECLARATION = Declared()


@cache
def of_node(op: str) -> Declared:
    """What a node declares; nothing if there is none of that name."""
    node = getattr(nodes, op, None)
    if node is None:
        return NO_DECLARATION
    page = node_page(node)
    lines = {name: dict(_PAGE_ITEM.findall(body)) for name, body in _PAGE_SECTION.findall(page)}
    return Declared(
        summary=page,
        inputs={**lines["Inputs"], "when": "Run only where this is not zero."},
        params=lines["Parameters"],
        outputs=lines["Outputs"],
        choices={name: each.choices for name, each in node.parameters.items()},
    )


def of_group(graph: Graph, name: str) -> Declared:
    """What the group of that name, or of the use of that name, takes from each use."""
    group = graph.group_of(name)
    assert group is not None
    inputs = {
        name: f"{'needed' if each.required else f'default {each.default}'}; {each.help}"
        for name, each in group.inputs.items()
    }
    params = {name: f"{each.state}; {each.help}" for name, each in group.body.params.items()}
    return Declared("", inputs, params, group.body.outputs)


def of_data(data: Mapping[str, Any]) -> Declared:
    """What a group takes whose text is not whole yet."""
    helps = {
        key: {
            name: str(mapping(each).get("help", ""))
            for name, each in mapping(data.get(key)).items()
        }
        for key in ("inputs", "params")
    }
    return Declared("", helps["inputs"], helps["params"], mapping(data.get("outputs")))
