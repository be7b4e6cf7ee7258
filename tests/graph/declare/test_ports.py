"""Ports: what an annotation says about a value, and which ports fit together."""

from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np
import pytest
from numpy.typing import NDArray
from typing_extensions import TypeAliasType

from tactograph.graph import GraphError, Port
from tactograph.graph.declare.ports import is_record, read_port, record_ports, record_values
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.plan.make_plan import make_plan
from tests.graph.conftest import SLOPES, Write


@pytest.mark.parametrize(
    ("annotation", "kind", "said"),
    [
        (
            Annotated[NDArray[np.uint8], Port("K 9 H", "LED bits")],
            "array",
            "uint8 K x 9 x H [LED bits]",
        ),
        (Annotated[float, Port(unit="mm/px")], "number", "number [mm/px]"),
        (float, "number", "number [1]"),
    ],
)
def test_a_port_has_dimensions_type_and_unit(annotation: Any, kind: str, said: str) -> None:
    port = read_port("light", annotation)
    assert (port.kind, str(port)) == (kind, said)


@pytest.mark.parametrize("python", [str, dict[str, float], list[int]])
def test_anything_else_is_an_object(python: Any) -> None:
    port = read_port("name", python)
    assert (port.kind, port.python) == ("object", python)


def test_or_none_makes_a_port_optional() -> None:
    port = read_port("truth", Annotated[NDArray[np.float32], Port("H W")] | None)
    assert (port.kind, port.optional) == ("array", True)


def test_a_record_is_a_port_for_each_field() -> None:
    class Pair(NamedTuple):
        name: str
        gain: float

    assert is_record(Pair)
    assert not is_record(tuple)
    ports = record_ports(Pair, "pair.")
    assert {field: port.name for field, port in ports.items()} == {
        "name": "pair.name", "gain": "pair.gain"
    }  # fmt: skip


class Inner(NamedTuple):
    low: float
    high: float


class Outer(NamedTuple):
    name: str
    inner: Inner
    gain: float


@pytest.mark.parametrize("made", [("x",), ("x", 1.0, 2.0, 3.0), {"a": 1, "b": 2}, None, "ab"])
def test_a_wrong_record_is_named(made: Any) -> None:
    with pytest.raises(TypeError, match=rf"Outer\(.*\) is declared, but a {type(made).__name__}"):
        record_values(Outer, made)


def test_a_record_with_two_ports_of_one_name_is_refused() -> None:
    class Twice(NamedTuple):
        low: float
        inner: Inner

    with pytest.raises(TypeError, match="Twice: two ports are called 'low'"):
        record_ports(Twice)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("height: height,", "height: pixel,", "pixel.pixel_size is number [mm/px]: a number is"),
        ("pixel: pixel}}\n  again", "pixel: height}}\n  again", "an array is not a number"),
        ("slope: slope.slope", "slope: height", "the numbers of axes differ"),
        ("slope: slope.slope", "slope: slope.mask", "the element types differ"),
        (
            "op: integrate_dct, in: {slope: slope.slope, pixel: pixel}",
            "op: in_metres, in: {height: height}",
            "'height' of in_metres wants float32 H x W [m], but height.read_height is "
            "float32 H x W [mm]: the units differ",
        ),
    ],
)
def test_ports_that_do_not_fit_are_both_named(
    toys: list[str], write: Write, old: str, new: str, message: str
) -> None:
    assert old in SLOPES
    graph = read_graph(write(SLOPES.replace(old, new)))
    with pytest.raises(GraphError) as caught:
        make_plan(graph, graph.placeholders, device=None)
    assert message in str(caught.value)
    assert "graph.yaml:" in str(caught.value)
    assert ".in." in str(caught.value)


@pytest.mark.parametrize(
    ("reader", "message"),
    [
        ("{op: in_metres, in: {height: frames.truth}}", "the units differ"),
        ("{op: rest_at_border, in: {height: frames.truth}}", "it may be absent"),
        ("{op: doubled, in: {image: frames.name}}", "an object is not an array"),
    ],
)
def test_a_value_that_may_be_absent_or_is_no_array_is_refused(
    toys: list[str], write: Write, reader: str, message: str
) -> None:
    text = f"format: 1\nnodes:\n  frames: {{op: touches}}\n  a: {reader}\noutputs: {{a: a}}"
    with pytest.raises(GraphError, match=message):
        make_plan(read_graph(write(text)), {}, device=None)


def test_an_array_may_be_written_as_an_alias() -> None:
    """An alias as NumPy 2.5 makes it from Python 3.12 on."""
    scalar = TypeVar("scalar", bound=np.generic)
    array = np.ndarray[Any, np.dtype[scalar]]  # type: ignore[valid-type]
    alias = TypeAliasType("alias", array, type_params=(scalar,))
    port = read_port("x", Annotated[alias[np.float32], Port("H W")])
    assert (port.kind, port.dims, port.dtype) == ("array", ("H", "W"), np.float32)
