"""A node is declared by its function's signature."""

from collections.abc import Callable, Iterator
from typing import Annotated, Any, NamedTuple, Unpack

import numpy as np
import pytest

from tactograph.graph import Close, NamedPorts, NodeCall, Port, Provenance, SizeLimit, node
from tactograph.graph.declare.find_node import find_node, shipped_nodes
from tactograph.nodes import F4, Height, Light, PixelSize
from tests.each import each


class Two(NamedTuple):
    light: Light
    pixel: PixelSize
    label: str = ""


class Inner(NamedTuple):
    low: float
    high: float


class Settings(NamedTuple):
    """Two settings.

    Parameters
    ----------
    gain
        Its gain.
    """

    gain: float
    floor: float = 0.1


class Named(NamedTuple):
    name: str
    time: float | None = None


class Outer(NamedTuple):
    inner: Inner
    gain: float


def test_positional_arguments_are_inputs_and_keyword_only_ones_are_parameters() -> None:
    @node
    def each(light: Light, pixel: PixelSize, *, gain: float, floor: float = 0.1) -> Height: ...

    assert list(each.inputs) == ["light", "pixel"]
    assert list(each.parameters) == ["gain", "floor"]
    assert each.parameters["gain"].required
    assert not each.parameters["floor"].required
    assert each.parameters["floor"].default == 0.1


def test_a_single_output_has_the_name_of_the_node_and_a_record_gives_several() -> None:
    @node
    def each(light: Light) -> Height: ...

    @node
    def pair(light: Light) -> Two: ...

    assert list(each.outputs) == ["each"]
    assert each.outputs["each"].dims == ("H", "W")
    assert list(pair.outputs) == ["light", "pixel", "label"]
    assert [port.kind for port in pair.outputs.values()] == ["array", "number", "object"]


def test_a_record_as_an_argument_is_an_input_for_each_of_its_fields() -> None:
    @node
    def each(two: Two) -> Height: ...

    assert list(each.inputs) == ["two.light", "two.pixel", "two.label"]
    assert each.input_records == {"two": Two}


def test_a_nested_record_has_flat_ports_and_reaches_the_function_nested() -> None:
    @node
    def each(outer: Outer) -> Outer:
        return outer._replace(gain=outer.inner.high)

    assert list(each.inputs) == ["outer.low", "outer.high", "outer.gain"]
    assert list(each.outputs) == ["low", "high", "gain"]
    arguments = each.in_order({"outer.low": 1.0, "outer.high": 2.0, "outer.gain": 3.0})
    assert each.results(each(*arguments)) == (1.0, 2.0, 2.0)


def test_an_unpacked_record_is_an_input_for_each_field_by_its_own_name() -> None:
    @node
    def each(*values: Unpack[Outer], gain_at_most: float) -> Outer:
        return Outer(*values)

    assert list(each.inputs) == ["inner.low", "inner.high", "gain"]
    assert list(each.parameters) == ["gain_at_most"]
    assert each.input_names == ["inner", "gain"]
    arguments = each.in_order({"inner.low": 1.0, "inner.high": 2.0, "gain": 3.0})
    assert each(*arguments, gain_at_most=4.0) == Outer(Inner(1.0, 2.0), 3.0)


def test_an_optional_record_that_is_left_out_is_none() -> None:
    @node
    def each(light: Light, named: Named | None = None) -> Height: ...

    assert list(each.inputs) == ["light", "named.name", "named.time"]
    assert each.optional_inputs == {"named"}
    assert each.in_order({"light": 1}) == [1, None]
    assert each.in_order({"light": 1, "named.name": "a"}) == [1, Named("a")]


def test_a_record_of_parameters_stands_for_its_fields() -> None:
    @node
    def each(light: Light, *, settings: Settings, scale: float = 2.0) -> Light:
        """Scale light."""
        return light * (scale * settings.gain + settings.floor)

    assert list(each.parameters) == ["gain", "floor", "scale"]
    assert each.parameters["gain"].required
    assert each.parameters["floor"].default == 0.1
    assert each(1.0, gain=3.0, floor=0.0) == 6
    assert each(1.0, settings=Settings(3.0, 0.0), scale=1.0) == 3, "a record counts as it is"
    assert each.about.arguments["gain"] == "Its gain."


def test_any_number_of_inputs_take_the_names_that_a_graph_gives_them() -> None:
    @node
    def each(*lights: Light) -> Light: ...

    two = each.with_inputs(["a", "b"])
    assert list(two.inputs) == ["a", "b"]
    assert two.inputs["b"].dims == ("K", "H", "W")
    assert two is each.with_inputs(["a", "b"])
    assert not each.source


def test_named_inputs_are_optional_and_have_the_types_of_their_names() -> None:
    types = {"light": Light, "outer": Outer}

    @node
    def each(gain: float, **more: Annotated[Any, NamedPorts(types.keys, types.__getitem__)]) -> int:
        return len(more) + int(gain)

    assert each.further_names == ["light", "outer"]
    sized = each.with_inputs(["gain", "outer", "unknown"])
    assert list(sized.inputs) == ["gain", "outer.low", "outer.high", "outer.gain"]
    assert sized.input_records == {"outer": Outer}
    assert sized.optional_inputs == {"outer"}
    assert sized.input_names == ["outer", "gain"]
    assert sized(*sized.in_order({"gain": 3.0})) == 4
    assert sized is each.with_inputs(["gain", "outer"])
    assert each.with_inputs(["gain"]) is each


def test_an_argument_with_a_default_is_an_optional_input() -> None:
    @node
    def each(light: Light, truth: Height | None = None) -> Height: ...

    assert each.optional_inputs == {"truth"}
    assert each.inputs["truth"].optional


def test_no_inputs_make_a_source_and_no_outputs_a_sink() -> None:
    @node
    def source() -> Height: ...

    @node
    def sink(height: Height) -> None: ...

    assert (source.source, source.sink) == (True, False)
    assert (sink.source, sink.sink) == (False, True)


def test_an_iterator_makes_a_stream() -> None:
    @node
    def stream() -> Iterator[Two]: ...

    @node
    def single() -> Two: ...

    assert stream.stream
    assert list(stream.outputs) == ["light", "pixel", "label"]
    assert not single.stream


def test_symbols_are_in_order_of_first_appearance() -> None:
    @node
    def each(height: Height, light: Light) -> Annotated[F4, Port("N 2")]: ...

    assert each.symbols == ("H", "W", "K", "N")


def test_provenance_comes_from_the_engine_and_is_no_parameter() -> None:
    @node
    def sink(height: Height, *, folder: str, provenance: Provenance) -> None: ...

    assert list(sink.parameters) == ["folder"]
    assert sink.provenance == "provenance"


def test_a_node_is_callable_as_the_plain_function() -> None:
    @node(neutral="light")
    def doubled(light: Light, *, by: float = 2.0) -> Light:
        """Doubles.

        More.
        """
        return light * np.float32(by)

    assert doubled(np.ones((1, 1, 1), np.float32), by=3.0)[0, 0, 0] == 3
    assert doubled.summary == "Doubles."


def test_back_ends_agree_exactly_unless_a_tolerance_says_otherwise() -> None:
    @node
    def exact(light: Light) -> Light: ...

    @node(tolerance=Close(1e-3, 1e-3, why="a sum"))
    def close(light: Light) -> Light: ...

    assert exact.tolerance == Close()
    assert close.tolerance == Close(1e-3, 1e-3, why="a sum")


def test_a_node_has_the_kernel_that_it_declares() -> None:
    @node
    def each(light: Light) -> Light: ...

    assert not each.has_kernel
    each.opencl(grid="H W")
    assert each.has_kernel
    assert each.kernels.grid == ("H", "W")


@pytest.mark.parametrize(("size", "refused"), [(2, True), (3, False), (8, False), (9, True)])
def test_a_size_limit_refuses_sizes_outside(size: int, refused: bool) -> None:
    assert SizeLimit(3, 8, "why").refuses(size) is refused


def no_type(light, *, gain: float = 1) -> Height: ...  # type: ignore[no-untyped-def]
def no_port(light: F4) -> Height: ...
def union(light: Light | Height) -> Height: ...
def no_port_out(light: Light) -> F4: ...
def no_node(light: Light, *, call: NodeCall = np.abs) -> Light: ...


def twice(light: Light, *, settings: Settings, gain: float = 2.0) -> Light: ...
def turned(light: Light) -> Height: ...
def pair(light: Light) -> Two: ...


@pytest.mark.parametrize(
    ("function", "neutral", "message"),
    [
        (no_type, {}, "no_type: argument 'light' has no type"),
        (no_port, {}, "port 'light': an array needs"),
        (union, {}, "a union of types cannot be a port"),
        (no_port_out, {}, "port 'no_port_out': an array needs"),
        (no_node, {}, "no_node: the default of 'call' has to be a node"),
        (twice, {}, "two parameters are called 'gain'"),
        (turned, {"neutral": "light"}, "neutral 'light' is not an input of the output's type"),
        (pair, {"neutral": 0}, "only a node with one output"),
    ],
)
def test_a_signature_that_declares_no_node_is_refused(
    function: Callable[..., Any], neutral: dict[str, Any], message: str
) -> None:
    with pytest.raises(TypeError, match=message):
        node(**neutral)(function)


@each("name", shipped_nodes())
def test_every_built_in_node_has_a_summary(name: str) -> None:
    shipped = find_node(name)
    assert shipped.name == name
    assert 10 < len(shipped.summary) < 200
