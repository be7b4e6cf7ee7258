"""A control reaches what a parameter may be, and nothing else."""

from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
from annotated_types import Ge, Gt, Interval

from tactograph.graph import node
from tactograph.graph.declare.check_settings import check_settings
from tactograph.graph.declare.find_node import find_node, shipped_nodes
from tactograph.graph.errors import InputError
from tactograph.graph.files.flat_graph import Entry
from tactograph.nodes import Light
from tactograph.rings.tune.controls import Control, control_of


@node
def adjustable(
    light: Light,
    *,
    share: Annotated[float, Interval(ge=0, le=1)] = 0.25,
    wide: Annotated[float, Interval(ge=1e-4, le=1)] = 0.01,
    count: Annotated[int, Interval(ge=1, le=9)] = 3,
    free: float = 5.0,
    least: Annotated[float, Ge(0)] = 2.0,
    above: Annotated[float, Gt(0)] = 2.0,
    kind: Literal["one", "two"] = "one",
    on: bool = True,
    pair: tuple[float, float] | None = None,
    file: Path | None = None,
) -> Light:
    return light


def control(name: str, value: Any = None) -> Control:
    parameter = adjustable.parameters[name]
    value = parameter.default if value is None else value
    return control_of(parameter.type, parameter.limits, parameter.default, value)


def test_kinds_follow_from_declarations() -> None:
    kinds = {name: control(name).kind for name in adjustable.parameters}
    assert kinds == {
        **dict.fromkeys(("share", "wide", "count", "free", "least", "above"), "slider"),
        "kind": "choice", "on": "flag", "pair": "text", "file": "text",
    }  # fmt: skip
    assert control("kind").choices == ("one", "two")


def test_a_declared_range_is_the_slider_s() -> None:
    assert (control("share").low, control("share").high, control("share").log) == (0, 1, False)
    assert (control("wide").log, control("count").whole) == (True, True)


def test_an_open_range_holds_the_value_and_the_default() -> None:
    for name, value in (("free", 30.0), ("least", 100.0), ("above", 0.001), ("free", -3.0)):
        found = control(name, value)
        assert found.low <= value <= found.high


@pytest.mark.parametrize("name", ["share", "wide", "count", "free", "least", "above"])
def test_a_slider_goes_there_and_back(name: str) -> None:
    found = control(name)
    for place in (0, 1, 250, 500, 999, 1000):
        again = found.place(found.value(place))
        assert abs(again - place) <= (70 if found.whole else 8)
    assert found.value(0) == found.low
    assert found.value(1000) == pytest.approx(found.high)
    assert isinstance(control("count").value(333), int)


def test_every_place_of_every_slider_is_a_value_that_the_node_takes() -> None:
    for name in shipped_nodes():
        declared = find_node(name)
        arguments = {p.name: p.default for p in declared.parameters.values() if not p.required}
        for parameter in declared.parameters.values():
            default = parameter.default
            found = control_of(parameter.type, parameter.limits, default, default)
            if parameter.required or found.kind != "slider":
                continue
            for place in (0, 1, 137, 500, 1000):
                value = {**arguments, parameter.name: found.value(place)}
                needed = {n for n, p in declared.parameters.items() if p.required}
                try:
                    check_settings(declared, value, Entry(name).where)
                except InputError as error:
                    assert any(f"'{n}'" in str(error) for n in needed), error  # noqa: PT017
