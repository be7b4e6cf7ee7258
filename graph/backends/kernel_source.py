"""Kernel sources: headers expanded, and the signature compared with the declaration."""

import os
import re
import sys
import typing
from importlib import resources
from pathlib import Path
from typing import Any, Literal

from tactograph.graph.declare.node import Node
from tactograph.graph.declare.parameter import Parameter
from tactograph.graph.errors import NodeError

C_DTYPES = {
    "float": ("float32", "complex64"),
    "uchar": ("uint8",),
    "ushort": ("uint16",),
    "int": ("int32",),
    "uint": ("uint32",),
    "PIXEL": ("uint8", "uint16", "float32"),
}
"""Element types of the arrays that a kernel may read as a C type, or as vectors of it; the first is
that of a port, and of a number."""
_INCLUDE_LINE = re.compile(r'\s*#\s*include\s+"([^"]+)"\s*(?://.*)?$')

_MACRO_LINE = re.compile(r"^[ \t]*#[ \t]*define[ \t]+(\w+)[ \t]+([^\n]*)$", re.MULTILINE)
_TYPE_NAME = re.compile(r"\btypedef\s+(\w+)\s+(\w+)\s*;")
_KERNEL_HEAD = re.compile(r"\b(?:__)?kernel\b[^{};]*?\bvoid\s+(\w+)\s*\(([^)]*)\)")

Argument = tuple[str, str]
"""C type (with a star for a buffer) and name (without the underscore that avoids a built-in)."""


def kernel_source(node: Node) -> str:
    """The text of the node's ``.cl`` file with its headers inserted.

    Raises
    ------
    NodeError
        If a file does not exist.
    """
    return _with_headers(node, f"{node.name}.cl", set())


def kernel_file(node: Node) -> str:
    """The name of the node's ``.cl`` file in messages.

    Raises
    ------
    NodeError
        If there is no such file.
    """
    return _find(node, f"{node.name}.cl")[0]


def _with_headers(node: Node, file: str, written: set[str]) -> str:
    """The text of a file with each header inserted where it is first included.

    ``#line`` makes the compiler's messages name the original file and line.
    """
    name, text = _find(node, file)
    written.add(file)
    parts = [f'#line 1 "{name}"']
    for number, line in enumerate(text.splitlines(), start=1):
        header = _INCLUDE_LINE.match(line)
        if header is None:
            parts.append(line)
            continue
        if header[1] not in written:
            parts.append(_with_headers(node, header[1], written))
        parts.append(f'#line {number + 1} "{name}"')
    return "\n".join([*parts, ""])


def _find(node: Node, file: str) -> tuple[str, str]:
    """The name of a kernel's file or header in messages, and its text."""
    source = node.kernels.source
    if source is not None and file == f"{node.name}.cl":
        return _own(node, source)
    module = sys.modules.get(node.kernel_package)
    is_file = module is not None and not hasattr(module, "__path__")
    packages = () if is_file else (node.kernel_package,)
    for package in (*packages, "tactograph.kernels.headers"):
        resource = resources.files(package) / file
        if resource.is_file():
            name = f"{package.removeprefix('tactograph.').replace('.', '/')}/{file}"
            return name, resource.read_text(encoding="utf-8")
    if not packages:
        raise NodeError(f"node '{node.name}': there is no {file}; give opencl(source=…)")
    raise NodeError(f"node '{node.name}': there is no {file} in {node.kernel_package}")


def _own(node: Node, source: str | os.PathLike[str]) -> tuple[str, str]:
    """The kernels that a declaration states as text or as a path."""
    if isinstance(source, str) and ("{" in source or "\n" in source):
        return f"source of {node.name}", source
    try:
        return str(source), Path(source).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise NodeError(
            f"node '{node.name}': the kernel {source} cannot be read: {error}"
        ) from None


def expected_arguments(node: Node) -> list[Argument]:
    """The arguments of the kernel: inputs, outputs, sizes, parameters, in declared order."""
    arguments: list[Argument] = []
    for port in node.inputs.values():
        name = port.name.replace(".", "_")
        if port.kind == "array":
            c_type = "PIXEL" if port.name == node.kernels.integers else _c_type(port.dtype)
            arguments.append((f"{c_type}*", name))
        elif port.kind == "number":
            arguments.append(("float", name))
    for port in node.outputs.values():
        name = "out" if node.output_record is None else port.name
        arguments.append((f"{_c_type(port.dtype)}*", name))
    arguments += [("int", symbol) for symbol in node.symbols]
    for parameter in node.parameters.values():
        arguments += _parameter_arguments(node, parameter)
    return arguments


def scalar_type(annotation: Any) -> tuple[str, int, tuple[Any, ...]] | None:
    """C type, count and choices of a parameter that a kernel can take; None for any other."""
    if typing.get_origin(annotation) is typing.Annotated:
        annotation = typing.get_args(annotation)[0]
    if annotation is float:
        return "float", 1, ()
    if annotation in (int, bool):
        return "int", 1, ()
    if typing.get_origin(annotation) is Literal:
        return "int", 1, typing.get_args(annotation)
    if typing.get_origin(annotation) is tuple:
        members = [scalar_type(a) for a in typing.get_args(annotation)]
        if members and members[0] is not None and all(m == members[0] for m in members):
            return members[0][0], len(members), ()
    return None


def scalar_values(annotation: Any, value: Any) -> list[Any]:
    """The numbers of a parameter: the items of a tuple, or the index of a choice."""
    scalar = scalar_type(annotation)
    assert scalar is not None
    _, count, choices = scalar
    if choices:
        return [choices.index(value)]
    return [value] if count == 1 else [*value]


def _parameter_arguments(node: Node, parameter: Parameter) -> list[Argument]:
    scalar = scalar_type(parameter.annotation)
    if scalar is None:
        raise NodeError(
            f"node '{node.name}' has a kernel, but no kernel can take its parameter "
            f"'{parameter.name}'"
        )
    c_type, count, _ = scalar
    if count == 1:
        return [(c_type, parameter.name)]
    return [(c_type, f"{parameter.name}_{i}") for i in range(count)]


def _c_type(dtype: Any) -> str:
    return next(c_type for c_type, names in C_DTYPES.items() if names[0] == str(dtype))


def kernel_signatures(text: str) -> dict[str, list[Argument]]:
    """Read the arguments of every kernel from a source, by the kernel's name."""
    plain = re.sub(r"//[^\n]*|/\*.*?\*/", " ", text, flags=re.DOTALL).replace("\\\n", " ")
    macros = _macros(plain)
    signatures: dict[str, list[Argument]] = {}
    for name, head in _KERNEL_HEAD.findall(plain):
        # Arguments shared by several kernels are macros; vectors of LANES are typedefs.
        written = re.sub(r"\w+", lambda word: macros.get(word[0], word[0]), head)
        signatures[name] = [_argument(piece) for piece in written.split(",") if piece.strip()]
    return signatures


def _macros(plain: str) -> dict[str, str]:
    """Macros and typedefs with a single meaning; PIXEL, which has several, is left out."""
    meanings: dict[str, set[str]] = {}
    for name, text in (
        *_MACRO_LINE.findall(plain),
        *((new, old) for old, new in _TYPE_NAME.findall(plain)),
    ):
        meanings.setdefault(name, set()).add(text.strip())
    return {
        name: min(texts)
        for name, texts in meanings.items()
        if len({text.rstrip("0123456789") for text in texts}) == 1
    }


def _argument(piece: str) -> Argument:
    words = re.sub(r"\b(__)?(global|constant|local|const|restrict)\b", " ", piece)
    star = "*" if "*" in words else ""
    c_type, _, name = " ".join(words.replace("*", " ").split()).rpartition(" ")
    return c_type + star, name.rstrip("_")


def check_kernel(node: Node) -> None:
    """Compare the kernel of a node with a single launch with the node's declaration.

    Raises
    ------
    NodeError
        If a file does not exist, or the kernel takes other arguments.
    """
    if node.kernels.grid is None:
        return
    file, text = _find(node, f"{node.name}.cl")
    stated = kernel_signatures(text).get(node.name)
    if stated is None:
        raise NodeError(f"{file} has no kernel '{node.name}'")
    expected = [(c_type, name.rstrip("_")) for c_type, name in expected_arguments(node)]
    for index, (due, declared) in enumerate(zip(expected, stated, strict=False), start=1):
        if due != declared:
            raise NodeError(
                f"{file}: argument {index} is '{' '.join(declared)}', "
                f"but the declaration says '{' '.join(due)}'"
            )
    if len(expected) != len(stated):
        raise NodeError(
            f"{file}: the kernel takes {len(stated)} arguments, "
            f"but the declaration says {len(expected)}: "
            f"{', '.join(name for _, name in expected)}"
        )
