"""The page of a node holds what a user has to know."""

import inspect
import re
from typing import Annotated, Literal

import pytest
from annotated_types import Ge, Gt, Interval, Lt

from tactograph.graph.declare.find_node import find_node, shipped_nodes
from tactograph.graph.declare.node_page import node_page
from tactograph.graph.declare.parameter import Parameter
from tests.each import each


@each("name", shipped_nodes())
def test_every_input_and_parameter_is_described(name: str) -> None:
    about = find_node(name).about
    silent = [argument for argument, words in about.arguments.items() if not words]
    assert about.summary.endswith(".")
    # A node whose text explains its inputs need not repeat them.
    assert not [argument for argument in silent if argument in find_node(name).parameters]


@pytest.mark.parametrize(
    ("annotation", "words"),
    [
        (Annotated[float, Interval(ge=0, le=1)], "0 to 1"),
        (Annotated[float, Gt(0)], "above 0"),
        (Annotated[int, Ge(1), Lt(9)], "at least 1 and below 9"),
        (Literal["a", "b"], "one of a, b"),
        (Literal["a", "b"] | None, "one of a, b"),
        (Annotated[float, Gt(0)] | None, "above 0"),
        (float, ""),
    ],
)
def test_a_range_in_words(annotation: object, words: str) -> None:
    assert Parameter("x", annotation).range == words


@each("name", shipped_nodes())
def test_a_docstring_that_lists_arguments_lists_every_input(name: str) -> None:
    function = find_node(name).function
    listed = (inspect.getdoc(function) or "").partition("\nParameters\n")[2]
    inputs = [
        p for p in inspect.signature(function).parameters.values() if p.kind != p.KEYWORD_ONLY
    ]
    for port in inputs if listed else []:
        assert re.search(rf"^([*\w]+, )*\*{{0,2}}{port.name}(,| :|$)", listed, re.MULTILINE)


def test_a_page_states_units_ranges_and_defaults() -> None:
    page = node_page(find_node("flat_field"))
    assert "`flat` (float32 K x H x W [1]): Irradiance per LED" in page
    assert "; K x H x W, the untouched film" in page
    assert "`pixel` (number [mm/px]): Side of a pixel on" in node_page(find_node("find_ball"))
    assert "`floor` (default 0.02, above 0): lower bound" in page


def test_a_page_explains_the_values_of_a_record() -> None:
    meaning = "- `rim` (number [mm]): mm of film beyond the frame"
    assert meaning in node_page(find_node("read_calibration"))
    assert "- `null` (float32 K [1]): unit vector a" in node_page(find_node("write_calibration"))


@each("name", shipped_nodes())
def test_the_returns_section_is_read_to_its_end(name: str) -> None:
    doc = inspect.cleandoc(find_node(name).doc or "")
    returns = find_node(name).about.returns
    if "\nReturns\n" not in doc:
        assert not returns
        return
    section = doc.partition("\nReturns\n")[2].partition("\n\nRaises\n")[0].lstrip("-\n")
    for other in ("Notes", "Examples", "References"):
        section = section.partition(f"\n\n{other}\n")[0]
    assert returns == " ".join(section.split())
