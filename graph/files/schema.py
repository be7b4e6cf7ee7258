"""The JSON schema of graph files, generated from the nodes, for editors and checks."""

from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from tactograph.graph.declare.check_settings import model_of
from tactograph.graph.declare.find_node import find_node, shipped_nodes
from tactograph.graph.declare.node import Node
from tactograph.graph.declare.ports import CONDITION_INPUT, RESTING_INPUT
from tactograph.graph.files.apply_patch import IN_FILE, KEYS_BY_VERB
from tactograph.graph.files.graph_model import GraphModel, GroupFileModel, StudyModel
from tactograph.graph.files.read_graph import shipped_names


def make_schema() -> dict[str, Any]:
    """Return the schema: the file formats, and every built-in node with its ports and ranges.

    A file is a study if it has a `base`, a group if it has `inputs`, and otherwise a graph.
    """
    kinds: list[type[BaseModel]] = [GraphModel, StudyModel, GroupFileModel]
    _, schema = models_json_schema([(kind, "validation") for kind in kinds], by_alias=True)
    nodes = [find_node(name) for name in shipped_nodes()]
    definitions = schema["$defs"]
    for each in nodes:
        definitions[f"with_{each.name}"] = _settings(each, definitions)
    entry, change = definitions["NodeModel"], definitions["PatchModel"]
    named = {"anyOf": [{"enum": [n.name for n in nodes]}, {"description": "of another package"}]}
    definitions["op"] = {**entry["properties"]["op"], **named}
    definitions["by_op"] = {"allOf": [_rule(each) for each in nodes]}
    for each in (entry, change):
        each["properties"]["op"] = {"$ref": "#/$defs/op"}
        each["allOf"] = [{"$ref": "#/$defs/by_op"}]
    change["allOf"] += [_verb_rule(verb) for verb in KEYS_BY_VERB]
    change["anyOf"] = [{"required": [verb]} for verb in KEYS_BY_VERB]
    shipped = f" Shipped: {', '.join(shipped_names())}."
    definitions["GraphModel"]["properties"]["extends"]["description"] += shipped
    a_group, a_graph = _if_it_has("inputs", "GroupFileModel"), {"$ref": "#/$defs/GraphModel"}
    schema |= {**_if_it_has("base", "StudyModel"), "else": {**a_group, "else": a_graph}}
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "tactograph graph file"
    return schema


def _if_it_has(key: str, model: str) -> dict[str, Any]:
    return {"if": {"required": [key]}, "then": {"$ref": f"#/$defs/{model}"}}


def _verb_rule(verb: str) -> dict[str, Any]:
    """The keys that go with a verb of a patch."""
    needed, optional = KEYS_BY_VERB[verb]
    keys = sorted(IN_FILE.get(key, key) for key in {verb, *needed, *optional})
    rule: dict[str, Any] = {"required": sorted(needed), "propertyNames": {"enum": keys}}
    if {"op", "group"} <= optional:
        rule["oneOf"] = [{"required": ["op"]}, {"required": ["group"]}]
    return {"if": {"required": [verb]}, "then": rule}


def _settings(node: Node, definitions: dict[str, Any]) -> dict[str, Any]:
    """Schema of a node's parameters; each may also be a ``$param`` of the graph."""
    model = model_of(node).model_json_schema(ref_template="#/$defs/{model}")
    definitions.update(model.pop("$defs", {}))
    reference = {"type": "string", "pattern": r"^\$[A-Za-z_]\w*$"}
    words = node.about.arguments
    properties = {
        name: {"description": words[name], "anyOf": [rule, reference]}
        for name, rule in model.get("properties", {}).items()
    }
    return {
        "type": "object",
        "properties": properties,
        "required": model.get("required", []),
        "additionalProperties": False,
    }


def _rule(node: Node) -> dict[str, Any]:
    about, text = node.about, {"type": "string"}
    words = {
        n: f"{about.arguments[n]} ({node.inputs.get(n, 'a record')})" for n in node.input_names
    }
    words |= dict.fromkeys(node.further_names, "")
    words[CONDITION_INPUT] = "Run only where this is not zero."
    words[RESTING_INPUT] = "With `when`: the node whose values replace these if it rests."
    properties: dict[str, Any] = {
        "op": {"description": about.summary},
        "with": {"$ref": f"#/$defs/with_{node.name}"},
        "in": {
            "properties": {n: text | ({"description": w} if w else {}) for n, w in words.items()},
            "additionalProperties": text if node.repeated else False,
        },
    }
    this = {"required": ["op"], "properties": {"op": {"const": node.name}}}
    return {"if": this, "then": {"properties": properties}}
