"""The kinds of layers of the core and of rings; a kind is imported when it is first used."""

from collections.abc import Iterator, Mapping

from tactograph.graph import InputError
from tactograph.graph.errors import did_you_mean
from tactograph.graph.rings import bring, brought
from tactograph.nodes import HeightError
from tactograph.nodes.stream.touch import Layer, LayerKind, Touch


class LayerKinds(Mapping[str, LayerKind]):
    """Kinds of layers by name, each from the file ``layers/NAME.py`` of the core or a ring."""

    def __iter__(self) -> Iterator[str]:
        return iter(brought("layers"))

    def __len__(self) -> int:
        return len(brought("layers"))

    def __getitem__(self, name: str) -> LayerKind:
        module = bring("layers", name)
        if module is None:
            names = [*self]
            hint = did_you_mean(name, names) or f"; the kinds are {', '.join(names)}"
            raise InputError(f"no layer of a touch is called '{name}'{hint}")
        kind = getattr(module, "KIND", None)
        if not isinstance(kind, LayerKind):
            raise InputError(f"layer '{name}': KIND of {module.__name__} is not a LayerKind")
        return kind


def layer_kinds() -> LayerKinds:
    """Return all kinds by name, each imported when it is first used."""
    return LayerKinds()


def layers_of(touch: Touch) -> list[Layer]:
    """Return a touch's layers with their kinds, in the order of its graph."""
    kinds = layer_kinds()
    return [Layer(name, kinds[name], value) for name, value in touch.layers.items()]


def deviation_of(touch: Touch) -> HeightError | None:
    """Return the standard deviation of a touch's height; None if it has none."""
    return next((each.value for each in layers_of(touch) if each.kind.is_deviation), None)
