"""The page of a node: its docstring, ports and parameters."""

from tactograph.graph.declare.description import Description
from tactograph.graph.declare.node import Node
from tactograph.graph.declare.parameter import Parameter
from tactograph.graph.declare.ports import PortType


def node_page(node: Node) -> str:
    """Describe a node in Markdown: its inputs, parameters, outputs and errors."""
    node = node.with_inputs(node.further_names)
    about = node.about
    lines = [f"# {node.name}", "", about.summary, ""]
    if about.text:
        lines += [about.text, ""]
    lines += ["## Inputs", ""]
    if node.repeated:
        words = about.arguments[node.repeated.name]
        lines += [_item("any names", f"each {node.repeated}", words)]
    elif node.source:
        lines += ["None: it is a source."]
    lines += [_input(name, node, about) for name in node.input_names]
    lines += ["", "## Parameters", ""]
    lines += [_setting(p, about) for p in node.parameters.values()] or ["None."]
    lines += ["", "## Outputs", ""]
    lines += [_output(name, port) for name, port in node.outputs.items()]
    lines += [] if node.outputs else ["None: it is a sink."]
    lines += ["", about.returns] if about.returns else []
    if about.raises:
        lines += ["", "## Errors", "", *(f"- `{name}`: {cause}" for name, cause in about.raises)]
    return "\n".join([*lines, "", *_facts(node), ""])


def _input(name: str, node: Node, about: Description) -> str:
    record = node.input_records.get(name)
    kind = f"all outputs of a node that gives a {record.__name__}" if record else ""
    optional = ", may be left out" if name in node.optional_inputs else ""
    return _item(name, f"{kind or node.inputs[name]}{optional}", about.arguments[name])


def _setting(parameter: Parameter, about: Description) -> str:
    default = "needed" if parameter.required else f"default {parameter.default!r}"
    facts = ", ".join(filter(None, (default, parameter.range)))
    return _item(parameter.name, facts, about.arguments[parameter.name])


def _output(name: str, port: PortType) -> str:
    return _item(name, f"{port}{', may be absent' if port.optional else ''}", port.meaning)


def _item(name: str, facts: str, words: str) -> str:
    return f"- `{name}` ({facts}){': ' if words else ''}{words}"


def _facts(node: Node) -> list[str]:
    kernel = f"OpenCL kernel `{node.name}.cl`" if node.has_kernel else "no OpenCL kernel"
    facts = [f"Package {node.package}; {kernel}."]
    facts += [f"Calls `{each.name}`, on a device if there is one." for each in node.calls.values()]
    if node.neutral is not None:
        neutral = (
            f"`{node.neutral}` is passed on" if isinstance(node.neutral, str) else node.neutral
        )
        facts.append(f"Taken out (`neutral`): {neutral}.")
    facts += [f"{symbol}: {limit.why}." for symbol, limit in node.sizes.items()]
    return facts
