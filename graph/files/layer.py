"""A layer: the content of a graph file, an overlay, a variant or a study."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from tactograph.graph.disk.strict_yaml import Document, Path_, Place
from tactograph.graph.files.graph_model import GraphModel, StudyModel, VariantModel, validate


@dataclass(frozen=True)
class Layer:
    """The content of a file or a variant, and its place."""

    model: GraphModel | VariantModel
    document: Document
    name: str
    file: Path
    base: str = ""
    """The name of the graph that it is a variant, or a study, of."""
    siblings: Mapping[str, Layer] = field(default_factory=dict, compare=False, repr=False)
    """The variants of the same file."""

    @property
    def id(self) -> str:
        """Name of the layer: its file, and for a variant its name there."""
        return "/".join(map(str, (self.file.resolve(), *self.document.root[1:])))

    def place(self, index: int) -> Place:
        """Place of one of the names under `extends`."""
        names = self.document.data.get("extends")
        single = isinstance(names, str)
        path: Path_ = ("base",) if names is None else ("extends",) if single else ("extends", index)
        return self.document.place(path)

    def variants(self, base: str) -> dict[str, Layer]:
        """Variants in the file, as variants of the graph called `base`."""
        layers: dict[str, Layer] = {}
        stated = self.model.variants if isinstance(self.model, GraphModel) else {}
        for name, model in stated.items():
            part = self.document.part(("variants", name))
            layers[name] = Layer(model, part, name, self.file, base, layers)
        return layers


def read_layer(file: Path) -> Layer:
    """Read a graph file, an overlay or a study."""
    return layer_of(Document.read(file), file)


def layer_of(document: Document, file: Path) -> Layer:
    """The layer of a document that is, or is to be, the content of a file."""
    if isinstance(document.data, dict) and "base" in document.data:
        study = validate(document, StudyModel)
        model = GraphModel.model_construct(extends=[study.base], variants=study.variants)
        return Layer(model, document, file.stem, file, base=study.base)
    return Layer(validate(document, GraphModel), document, file.stem, file)
