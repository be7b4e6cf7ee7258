"""The kinds of layers: of the core, and of rings; a kind is imported when it is asked for."""

import importlib
import importlib.util
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path

from tactograph.graph import InputError
from tactograph.graph.errors import did_you_mean, message_of
from tactograph.nodes import HeightError
from tactograph.nodes.stream.touch import Layer, LayerKind, Touch

RING_GROUP = "tactograph.rings"
"""Entry points whose values are packages; the folder ``layers`` of one holds kinds of layers."""
HOUSE_ROOMS = tuple(
    f"tactograph.nodes{room}" for room in ("", ".marker", ".motion", ".force", ".metrology")
)


class LayerKinds(Mapping[str, LayerKind]):
    """Kinds of layers by name; `modules` are those that declare them, by name."""

    def __init__(self, modules: Mapping[str, str]) -> None:
        self._modules = modules

    def __iter__(self) -> Iterator[str]:
        return iter(self._modules)

    def __len__(self) -> int:
        return len(self._modules)

    def __getitem__(self, name: str) -> LayerKind:
        if name not in self._modules:
            there = did_you_mean(name, self._modules) or f"; there are {', '.join(self._modules)}"
            raise InputError(f"no layer of a touch is called '{name}'{there}")
        module = self._modules[name]
        try:
            kind = importlib.import_module(module).KIND
        # A ring of someone else can raise any exception.
        except Exception as error:
            why = message_of(error) or type(error).__name__
            raise InputError(f"layer '{name}': {module} does not load: {why}") from None
        if not isinstance(kind, LayerKind):
            raise InputError(f"layer '{name}': KIND of {module} is no LayerKind")
        return kind


def layer_kinds() -> LayerKinds:
    """Return the kinds that there are, by name; none is imported before it is asked for."""
    return _kinds(tuple(sys.path))


@cache
def _kinds(path: tuple[str, ...]) -> LayerKinds:
    """The kinds on `path`: those of the core come first, so that graphs keep their meaning."""
    modules: dict[str, str] = {}
    for package in (*HOUSE_ROOMS, *(point.value for point in entry_points(group=RING_GROUP))):
        spec = importlib.util.find_spec(package)
        for folder in (spec and spec.submodule_search_locations) or ():
            for file in sorted(Path(folder, "layers").glob("[!_]*.py")):
                modules.setdefault(file.stem, f"{package}.layers.{file.stem}")
    return LayerKinds(modules)


def layers_of(touch: Touch) -> list[Layer]:
    """Return a touch's layers with their kinds, in the order in which its graph names them."""
    kinds = layer_kinds()
    return [Layer(name, kinds[name], value) for name, value in touch.layers.items()]


def deviation_of(touch: Touch) -> HeightError | None:
    """Return the standard deviation of a touch's height; None if it holds none."""
    return next((each.value for each in layers_of(touch) if each.kind.is_deviation), None)
