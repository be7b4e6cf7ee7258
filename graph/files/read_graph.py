"""Read a graph: parse strict YAML, follow `extends`, lay overlays over it, and place all errors."""

import os
from collections.abc import Container, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, Self

from tactograph.graph.disk.strict_yaml import Document
from tactograph.graph.errors import ErrorsTogether, GraphError, InputError, did_you_mean
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.files.graph_model import GraphModel, VariantModel, validate
from tactograph.graph.files.graph_places import Shipped, find_file, shipped, variants_added_to
from tactograph.graph.files.lay_over import alone, blamed_on, group_in, laid_over
from tactograph.graph.files.layer import Layer, layer_of, read_layer
from tactograph.graph.files.plain_data import as_document

Source = str | os.PathLike[str] | Mapping[str, Any] | Graph
"""A graph by name, by path, as plain data, or as a `Graph`."""
Chain = tuple[str, ...]
"""The files and variants whose `extends` led here."""
_OVERLAY_FOLDER = "overlays, for --with"


def shipped_names(kind: Shipped = "graphs") -> list[str]:
    """Bare names of the shipped files of a kind; of graphs with their variants."""
    if kind != "graphs":
        return sorted(shipped(kind))
    folders = shipped_titles()
    del folders[_OVERLAY_FOLDER]
    return sorted(name for titles in folders.values() for name in titles)


def shipped_titles() -> dict[str, dict[str, str]]:
    """The titles of shipped graphs by folder and name; variants of a study are under the study."""
    by_heading: dict[str, dict[str, str]] = {}
    for name, file in {**shipped("graphs"), **shipped("studies")}.items():
        layer = read_layer(file)
        heading = f"study {name}, for compare" if layer.base else file.parent.name
        titles = by_heading.setdefault(heading, {})
        if not layer.base:
            titles[name] = layer.model.title
        for key, variant in _variants(layer).items():
            titles[f"{variant.base}_{key}"] = variant.model.title
    overlays = shipped("overlays").items()
    by_heading[_OVERLAY_FOLDER] = {name: read_layer(file).model.title for name, file in overlays}
    return by_heading


def read_graph(source: Source) -> Graph:
    """Read a graph: a path, the name of a shipped pipeline, or plain data like a file's.

    ``FILE.yaml/NAME`` is a variant in a file, ``GRAPH_NAME`` a variant of a shipped graph, or the
    graph with a shipped overlay.

    Raises InputError if there is no such file; GraphError with file, line, column, path and reason
    if it is not a graph file.
    """
    if isinstance(source, Graph):
        return source
    if isinstance(source, Mapping):
        document = as_document(source)
        layer = Layer(validate(document, GraphModel), document, "graph", Path("graph"))
        return _graph_of(layer, ())
    if not isinstance(source, str | os.PathLike):
        raise InputError(f"{source!r}: a graph's name, its file, or plain data is needed")
    return _named(os.fspath(source), None, ())


def read_graphs(name: str) -> list[Graph]:
    """The graph of that name; for a study, its base and all variants."""
    file = None
    with suppress(InputError):  # `read_graph` reports it
        file = find_file(name, None, "studies")
    if file is None or not (layer := read_layer(file)).base:
        return [read_graph(name)]
    base = _graph_of(layer, ())
    return [base, *variants_of(base, file)]


class GraphFile(NamedTuple):
    """The file of a graph, an overlay or a group."""

    place: Path

    @staticmethod
    def names(kind: Shipped = "graphs") -> list[str]:
        """Return the bare names of the shipped files of a kind; of graphs with their variants."""
        return shipped_names(kind)

    @classmethod
    def find(cls, name: str, beside: Path, kind: Shipped) -> Self | None:
        """Return the file of a name or a path `beside` another, as `extends` states it."""
        place = find_file(name, beside, kind)
        return None if place is None else cls(place)

    def graphs_of(self, text: str) -> list[Graph]:
        """Return the graph and the variants of its text; none for a group or overlay.

        Raises the errors of `read_graph`.
        """
        file, document = self.place, Document.parse(text, str(self.place))
        if file.name.endswith(".group.yaml"):
            group_in(file.name, document)
            return []
        layer = layer_of(document, file)
        assert isinstance(layer.model, GraphModel)
        if not (layer.model.nodes or layer.model.extends):
            return []
        graph = _graph_of(layer, ())
        return [graph, *variants_of(graph, file)]


def variants_of(graph: Graph, file: Path) -> list[Graph]:
    """The variants in a file that holds the graph, or has it as base."""
    names = [name for name, each in graph.variants.items() if each.file == file]
    laid = ErrorsTogether.of_all(names, lambda name: _lay(graph, graph.variants[name], ()))
    return [*laid.values()]


def with_overlays(graph: Graph, names: Iterable[str]) -> Graph:
    """Lay overlays over a graph, in order: its own variants, shipped ones, or files.

    Raises InputError if there is no such overlay, or it does not fit the graph.
    """
    for name in names:
        graph = _overlaid(graph, name, None, ())
    return graph


def _file_and_variant(name: str) -> tuple[str, str]:
    """Split ``FILE.yaml/NAME``."""
    file, _, key = name.rpartition("/")
    return (file, key) if file.endswith((".yaml", ".yml")) else (name, "")


def _named(name: str, base_folder: Path | None, chain: Chain) -> Graph:
    file_name, key = _file_and_variant(name)
    try:
        file = find_file(file_name, base_folder, "graphs")
    except InputError as error:
        joined = name.replace("/", "_")
        hint = "" if _shipped_variant(joined) is None else f"; did you mean '{joined}'?"
        raise InputError(f"{error}{hint}") from None
    if file is None:
        return _composed(name, chain)
    layer = read_layer(file)
    graph = _graph_of(layer, chain)
    if not key:
        if layer.base:
            raise InputError(_of_a_study(name, graph))
        return graph
    return _lay(graph, _variant_of(file, graph.variants, key), chain)


def _variant_of(file: Path, variants: Mapping[str, Layer], key: str) -> Layer:
    if key not in variants:
        hint = did_you_mean(key, variants) or f" (it has: {', '.join(variants) or 'none'})"
        raise InputError(f"{file}: there is no variant '{key}'{hint}")
    return variants[key]


def _composed(name: str, chain: Chain) -> Graph:
    """A shipped graph whose name is followed by names of variants or overlays."""
    variant = _shipped_variant(name)
    if variant is not None:
        return _lay(_named(variant.base, None, chain), variant, chain)
    for first, rest in _splits(name):
        if first in shipped("graphs"):
            graph = _named(first, None, chain)
            overlays = _in_words(rest, graph.variants)
            if overlays:
                return with_overlays(graph, overlays)
    if name in shipped("studies"):
        raise InputError(_of_a_study(name, read_graphs(name)[0]))
    if name in shipped("overlays"):
        raise InputError(
            f"'{name}' is an overlay; lay it over a graph: 'tactograph run GRAPH --with {name}'"
        )
    hint = did_you_mean(name, shipped_names(), "tactograph graphs")
    raise InputError(f"'{name}' is neither a graph file (.yaml) nor a pipeline that ships{hint}")


def _of_a_study(name: str, base: Graph) -> str:
    graphs = ", ".join(f"{base.name}_{key}" for key in base.variants)
    return f"'{name}' is a study; 'tactograph compare {name}' runs all its graphs: {graphs}"


def _shipped_variant(name: str) -> Layer | None:
    """The shipped variant that ``GRAPH_VARIANT`` names, if there is one."""
    graphs = shipped("graphs")
    files = [graphs[first] for first, _ in _splits(name) if first in graphs]
    for file in (*files, *shipped("studies").values()):
        layer = read_layer(file)
        for key, variant in _variants(layer).items():
            if name == f"{variant.base}_{key}":
                return variant
    return None


def _in_words(text: str, variants: Container[str]) -> tuple[str, ...]:
    """The overlays and variants whose names are joined in a text; empty if a part is neither."""

    def is_layer(name: str) -> bool:
        own = name in variants or name in shipped("overlays")
        return own or _shipped_variant(name) is not None

    if is_layer(text):
        return (text,)
    for first, rest in _splits(text):
        if is_layer(first) and (others := _in_words(rest, variants)):
            return (first, *others)
    return ()


def _splits(words: str) -> Iterator[tuple[str, str]]:
    return ((words[:at], words[at + 1 :]) for at, c in enumerate(words) if c == "_")


def _further(chain: Chain, layer: Layer) -> Chain:
    """Add a file or variant to the chain; refuse one that is already in it."""
    if layer.id in chain:
        loop = " -> ".join(Path(each).name for each in (*chain, layer.id))
        raise GraphError(f"{layer.file}: 'extends' runs in a loop: {loop}")
    return (*chain, layer.id)


def _graph_of(layer: Layer, chain: Chain) -> Graph:
    """The graph of a file, with `extends` followed; for a study, its base."""
    model, chain = layer.model, _further(chain, layer)
    assert isinstance(model, GraphModel)
    if not model.extends:
        return replace(alone(layer), variants=_variants(layer))
    if model.nodes is not None:
        raise GraphError(
            f"{layer.document.place(('nodes',))}: a file that extends another has no 'nodes'; "
            "add one with '- insert: ID' under 'patch'"
        )
    with blamed_on(layer.place(0)):
        graph = _named(model.extends[0], layer.file.parent, chain)
    if layer.base:
        return replace(graph, variants=layer.variants(graph.name))
    for index, name in enumerate(model.extends[1:], start=1):
        with blamed_on(layer.place(index)):
            graph = _overlaid(graph, name, layer.file.parent, chain)
    # A variant with its own base is a variant of that graph alone.
    inherited = {key: each for key, each in graph.variants.items() if _base_of(each) is None}
    return replace(
        laid_over(graph, layer),
        name=layer.name,
        title=model.title or graph.title,
        variants={**inherited, **_variants(layer)},
    )


def _variants(layer: Layer) -> dict[str, Layer]:
    """The variants in a file, and those that rings add to it if it ships."""
    variants = layer.variants(layer.base or layer.name)
    ships = shipped("graphs").get(layer.name)
    if layer.base or ships is None or ships.resolve() != layer.file.resolve():
        return variants
    added = map(read_layer, variants_added_to(layer.name))
    return {
        key: each for file in added for key, each in file.variants(layer.name).items()
    } | variants


def _base_of(layer: Layer) -> str | None:
    return layer.model.base if isinstance(layer.model, VariantModel) else None


def _overlaid(graph: Graph, name: str, base_folder: Path | None, chain: Chain) -> Graph:
    """Lay an overlay or a variant over a graph."""
    layer = _overlay(graph.variants, name, base_folder, chain)
    try:
        return _lay(graph, layer, chain)
    except GraphError as error:
        raise InputError(f"'{name}' does not fit {graph.name}: {error}") from None


def _overlay(
    variants: Mapping[str, Layer], name: str, base_folder: Path | None, chain: Chain
) -> Layer:
    """One of these variants, an overlay, or (by its full name) a variant of another graph.

    A variant that extends its own name means the overlay of that name.
    """
    if name in variants and variants[name].id not in chain:
        return variants[name]
    file_name, key = _file_and_variant(name)
    file = find_file(file_name, base_folder, "overlays")
    if file is None:
        variant = _shipped_variant(name)
        if variant is not None:
            return replace(variant, name=name)
        if name in variants:
            _further(chain, variants[name])  # which reports the loop
        names = list(dict.fromkeys([*variants, *shipped("overlays")]))
        hint = did_you_mean(name, names) or f" (there are: {', '.join(names)})"
        if name in shipped("graphs"):
            hint = "; it is a graph, and only the first of 'extends' can be one"
        raise InputError(f"there is no overlay '{name}'{hint}")
    layer = read_layer(file)
    if key:
        return _variant_of(file, layer.variants(layer.name), key)
    for part in ("base", "nodes", "variants"):
        if part in layer.document.data:
            raise GraphError(f"{layer.document.place((part,))}: an overlay has no '{part}'")
    return layer


def _lay(graph: Graph, layer: Layer, chain: Chain) -> Graph:
    """Lay a variant or an overlay over a graph, after the overlays that it extends."""
    chain, below, base = _further(chain, layer), graph, _base_of(layer)
    if base is not None:
        with blamed_on(layer.document.place(("base",))):
            if layer.base != graph.name:
                raise InputError("a whole graph, not an overlay")
            below = _named(base, layer.file.parent, chain)
    for index, name in enumerate(layer.model.extends):
        with blamed_on(layer.place(index)):
            below = _lay(below, _overlay(layer.siblings, name, layer.file.parent, chain), chain)
    title = layer.model.title
    if layer.base and layer.base != graph.name and below.title != graph.title:
        title = below.title  # made by the overlays below it
    elif layer.base != graph.name or not title:
        title = ", ".join(filter(None, [graph.title, layer.name if layer.base else title]))
    return replace(laid_over(below, layer), name=f"{graph.name}_{layer.name}", title=title)
