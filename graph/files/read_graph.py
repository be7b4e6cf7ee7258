"""Read a graph: strict YAML, `extends` followed, overlays laid over it, all errors placed.

A variant, an overlay and a file that extends another say the same things and are laid over a
graph by the same steps; see `_lay`.
"""

from __future__ import annotations

import os
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from tactograph.graph.errors import GraphError, InputError, did_you_mean
from tactograph.graph.files.flat_graph import Graph, split_previous, split_reference
from tactograph.graph.files.graph_model import GraphModel, StudyModel, VariantModel, validate
from tactograph.graph.files.graph_places import (
    find_file,
    is_file,
    is_path,
    shipped_graphs,
    shipped_overlays,
    shipped_studies,
)
from tactograph.graph.files.layer import Layer, alone, blamed_on, laid_over, load
from tactograph.graph.files.plain_data import as_document
from tactograph.graph.files.strict_yaml import Document, read_yaml

Source = str | os.PathLike[str] | Mapping[str, Any] | Graph
"""A graph by name, by path, as plain data, or as it is."""
Chain = tuple[Path, ...]
"""The files and variants whose `extends` led here."""


def shipped_names() -> list[str]:
    """The bare names of the graphs that ship, those of variants among them."""
    return sorted(name for _, name, _ in _shipped())


def shipped_titles() -> dict[str, dict[str, str]]:
    """The titles of what ships, by name, by folder; of variants in a study, by study."""
    found: dict[str, dict[str, str]] = {}
    for heading, name, title in _shipped():
        found.setdefault(heading, {})[name] = title
    overlays = {name: load(file, GraphModel)[0] for name, file in shipped_overlays().items()}
    found["overlays, for --with"] = {name: model.title for name, model in overlays.items()}
    return found


def _shipped() -> Iterator[tuple[str, str, str]]:
    """Heading, name and title of every graph that ships."""
    for name, file in shipped_graphs().items():
        model, _ = load(file, GraphModel)
        yield file.parent.name, name, model.title
        for key, variant in model.variants.items():
            yield file.parent.name, f"{name}_{key}", variant.title
    for name, file in shipped_studies().items():
        study, _ = load(file, StudyModel)
        for key, variant in study.variants.items():
            yield f"study {name}, for compare", f"{study.base}_{key}", variant.title


def graph_file(name: str) -> Path:
    """The file in which the graph of that name stands.

    Raises
    ------
    InputError
        If there is neither such a file nor a shipped pipeline of that name.
    """
    file = find_file(_file_and_variant(name)[0], None, shipped_graphs())
    return file or Path(read_graph(name).places[""].file)


def read_graph(source: Source) -> Graph:
    """Read a graph: a path, the name of a shipped pipeline, or plain data like a file's.

    ``FILE.yaml/NAME`` is a variant of a file of one's own, ``GRAPH_NAME`` one of a shipped graph,
    or the graph with a shipped overlay.

    Raises
    ------
    InputError
        If the file is not there.
    GraphError
        With file, line, column, path and reason, if it is not a graph file.
    """
    if isinstance(source, Graph):
        return source
    if isinstance(source, Mapping):
        document = as_document(source)
        model = validate(document, GraphModel)
        return _graph_of(Layer(model, document, "graph", Path(), Path()), ())
    return _named(os.fspath(source), None, ())


def read_graphs(name: str) -> list[Graph]:
    """The graph of that name; of a study, its base and all its variants."""
    file = _study_file(name)
    if file is None:
        return [read_graph(name)]
    base, variants = _read_study(file, ())
    return [base, *(_lay(base, layer, ()) for layer in variants.values())]


def with_overlays(graph: Graph, names: Iterable[str]) -> Graph:
    """Lay overlays over a graph, in order: its own variants, shipped ones, or files.

    Raises
    ------
    InputError
        If there is no such overlay, or it does not fit the graph.
    """
    for name in names:
        laid = _overlaid(graph, name, None, ())
        try:
            _refuse_gaps(graph, laid)
        except GraphError as error:
            raise InputError(_misfit(graph, name, error)) from None
        graph = laid
    return graph


def _file_and_variant(name: str) -> tuple[str, str]:
    """Split ``FILE.yaml/NAME``."""
    file, _, key = name.rpartition("/")
    return (file, key) if file.endswith((".yaml", ".yml")) else (name, "")


def _named(name: str, beside: Path | None, chain: Chain) -> Graph:
    file_name, key = _file_and_variant(name)
    file = find_file(file_name, beside, shipped_graphs())
    if file is None:
        return _composed(name, chain)
    if _is_study(file):
        base, variants = _read_study(file, chain)
        if not key:
            raise InputError(_of_a_study(file.name, base, variants))
    else:
        base = _graph_of(_graph_layer(file), _further(chain, file))
        variants = {**base.variants}
    if not key:
        return base
    if key not in variants:
        hint = did_you_mean(key, variants) or f" (it has: {', '.join(variants) or 'none'})"
        raise InputError(f"{file}: there is no variant '{key}'{hint}")
    return _lay(base, variants[key], chain)


def _composed(name: str, chain: Chain) -> Graph:
    """A shipped graph with variants or overlays, whose names follow its own."""
    base, layer = _shipped_variant(name)
    if layer is not None:
        return _lay(_named(base, None, chain), layer, chain)
    for first, rest in _splits(name):
        if first in shipped_graphs():
            graph = _named(first, None, chain)
            overlays = _in_words(rest, graph.variants)
            if overlays:
                return with_overlays(graph, overlays)
    if name in shipped_studies():
        raise InputError(_of_a_study(name, *_read_study(shipped_studies()[name], chain)))
    if name in shipped_overlays():
        raise InputError(
            f"'{name}' is an overlay; lay it over a graph: 'tactograph run GRAPH --with {name}'"
        )
    hint = did_you_mean(name, shipped_names())
    there = f" (the shipped ones are: {', '.join(shipped_names())})"
    raise InputError(
        f"'{name}' is neither a graph file (.yaml) nor a pipeline that ships{hint or there}"
    )


def _shipped_variant(name: str) -> tuple[str, Layer | None]:
    """The graph's name and the variant that ``GRAPH_VARIANT`` stands for, if it ships."""
    for file in shipped_studies().values():
        study, document = load(file, StudyModel)
        key = name.removeprefix(f"{study.base}_")
        if key != name and key in study.variants:
            return study.base, _variants(study.variants, document, file, study.base)[key]
    for first, rest in _splits(name):
        if first in shipped_graphs():
            file = shipped_graphs()[first]
            model, document = load(file, GraphModel)
            if rest in model.variants:
                return first, _variants(model.variants, document, file, first)[rest]
    return "", None


def _in_words(text: str, variants: Container[str]) -> tuple[str, ...]:
    """The overlays and variants whose names are joined in a text; none if a part is neither."""

    def is_known(name: str) -> bool:
        known = name in variants or name in shipped_overlays()
        return known or _shipped_variant(name)[1] is not None

    if is_known(text):
        return (text,)
    for first, rest in _splits(text):
        if is_known(first) and (others := _in_words(rest, variants)):
            return (first, *others)
    return ()


def _splits(words: str) -> Iterator[tuple[str, str]]:
    for at, letter in enumerate(words):
        if letter == "_":
            yield words[:at], words[at + 1 :]


def _graph_layer(file: Path) -> Layer:
    model, document = load(file, GraphModel)
    return Layer(model, document, file.stem, file.parent, file)


def _is_study(file: Path) -> bool:
    data = read_yaml(file).data
    return isinstance(data, dict) and "base" in data


def _study_file(name: str) -> Path | None:
    """The file of a study; None for the name of anything else."""
    file = shipped_studies().get(name)
    if file is None and is_path(name) and is_file(Path(name)) and _is_study(Path(name)):
        file = Path(name)
    return file


def _read_study(file: Path, chain: Chain) -> tuple[Graph, dict[str, Layer]]:
    """The graph that a study is of, and its variants."""
    study, document = load(file, StudyModel)
    with blamed_on(document.place(("base",))):
        base = _named(study.base, file.parent, _further(chain, file))
    return base, _variants(study.variants, document, file, base.name)


def _of_a_study(name: str, base: Graph, variants: Iterable[str]) -> str:
    graphs = ", ".join(f"{base.name}_{key}" for key in variants)
    return f"'{name}' is a study; 'tactograph compare {name}' runs all its graphs: {graphs}"


def _variants(
    stated: Mapping[str, VariantModel], document: Document, file: Path, of: str
) -> dict[str, Layer]:
    found: dict[str, Layer] = {}
    for key, model in stated.items():
        part = document.part(("variants", key))
        found[key] = Layer(model, part, key, file.parent, file / key, of, found)
    return found


def _further(chain: Chain, path: Path) -> Chain:
    """The chain with one more file or variant, which must not be in it."""
    resolved = path.resolve()
    if resolved in chain:
        loop = " -> ".join(each.name for each in (*chain, resolved))
        raise GraphError(f"{path}: 'extends' runs in a loop: {loop}")
    return (*chain, resolved)


def _graph_of(layer: Layer, chain: Chain) -> Graph:
    """The graph of a file, with `extends` followed."""
    model, document = layer.model, layer.document
    assert isinstance(model, GraphModel)
    own = _variants(model.variants, document, layer.path, layer.name)
    if not model.extends:
        return replace(alone(layer), variants=own)
    if model.nodes is not None:
        raise GraphError(
            f"{document.place(('nodes',))}: a file that extends another has no 'nodes'; "
            "add one with '- insert: ID' under 'patch'"
        )
    with blamed_on(layer.overlay(0)):
        graph = _named(model.extends[0], layer.folder, chain)
    for index, name in enumerate(model.extends[1:], start=1):
        with blamed_on(layer.overlay(index)):
            graph = _overlaid(graph, name, layer.folder, chain)
    # A variant that names a base of its own is one of that file's graph alone.
    inherited = {key: each for key, each in graph.variants.items() if not _has_base(each)}
    changed = laid_over(graph, layer)
    return replace(
        changed,
        name=layer.name,
        title=model.title or graph.title,
        variants={**inherited, **own},
    )


def _has_base(layer: Layer) -> bool:
    return isinstance(layer.model, VariantModel) and layer.model.base is not None


def _overlaid(graph: Graph, name: str, beside: Path | None, chain: Chain) -> Graph:
    """A graph with an overlay, or with a variant, laid over it."""
    layer = _overlay(graph.variants, name, beside, chain)
    try:
        return _lay(graph, layer, chain)
    except GraphError as error:
        raise InputError(_misfit(graph, name, error)) from None


def _misfit(graph: Graph, name: str, error: GraphError) -> str:
    return f"'{name}' does not fit {graph.name}: {error}"


def _overlay(variants: Mapping[str, Layer], name: str, beside: Path | None, chain: Chain) -> Layer:
    """One of some variants, an overlay, or a variant of another graph, by its full name.

    A variant extends the overlay of its own name, not itself.
    """
    own = variants.get(name)
    if own is not None and own.path.resolve() not in chain:
        return own
    file = find_file(name, beside, shipped_overlays())
    if file is None:
        _, variant = _shipped_variant(name)
        if variant is not None:
            return replace(variant, name=name)
        known = [*variants, *shipped_overlays()]
        hint = did_you_mean(name, known) or f" (there are: {', '.join(known)})"
        if name in shipped_graphs():
            hint = "; it is a graph, and only the first of 'extends' can be one"
        raise InputError(f"there is no overlay '{name}'{hint}")
    layer = _graph_layer(file)
    for key in ("nodes", "variants"):
        if key in layer.document.data:
            raise GraphError(f"{layer.document.place((key,))}: an overlay has no '{key}'")
    return layer


def _lay(graph: Graph, layer: Layer, chain: Chain) -> Graph:
    """A graph with a variant or an overlay, and the overlays that this extends."""
    chain = _further(chain, layer.path)
    model, below = layer.model, graph
    if isinstance(model, VariantModel) and model.base is not None:
        place = layer.document.place(("base",))
        if layer.of != graph.name:
            raise GraphError(f"{place}: a graph of its own, which lies over no other")
        with blamed_on(place):
            below = _named(model.base, layer.folder, chain)
    for index, name in enumerate(model.extends):
        with blamed_on(layer.overlay(index)):
            below = _lay(below, _overlay(layer.beside, name, layer.folder, chain), chain)
    changed = laid_over(below, layer)
    title = model.title
    if layer.of != graph.name or not title:
        words = layer.name if layer.of else title
        title = ", ".join(filter(None, [graph.title, words]))
    return replace(changed, name=f"{graph.name}_{layer.name}", title=title)


def _refuse_gaps(before: Graph, graph: Graph) -> None:
    """Refuse what an overlay reads if the graph before it does not have it."""
    for name, entry in graph.nodes.items():
        if name not in before.nodes or before.nodes[name].inputs != entry.inputs:
            for port, reference in entry.inputs.items():
                read = split_reference(split_previous(reference)[0], graph.nodes)[0]
                graph.check_node(read, entry.where(f"in.{port}"))
