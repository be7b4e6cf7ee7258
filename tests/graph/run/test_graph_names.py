"""Messages of nodes name the params of the graph that runs them, whatever these are called."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tactograph.graph import Cache, InputError, Port, Provenance, load, node, warn
from tactograph.graph.declare.find_node import own_nodes
from tactograph.graph.errors import collect_warnings
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.plan.feeds import feed_of
from tactograph.graph.plan.make_plan import make_plan
from tactograph.graph.run.open_pipeline import open_pipeline

Row = Annotated[NDArray[np.float32], Port("W")]
TOLD: list[str] = []


@node
def rows(*, file: Path | None = None, count: int = 2) -> Iterator[Row]:
    """Yield rows; warn of their number and refuse a fourth."""
    for number in range(count):
        warn(f"row {number}: `count`={count} rows; `file` is not read")
        if number == 3:
            raise InputError(f"`count`={count}: at most 3")
        yield np.full(5, number, np.float32)


@node
def checked(row: Row, other: Row | None = None, *, limit: float = 9.0, least: float = 0.0) -> Row:
    """Refuse large rows, and warn of all others."""
    if row.max() > limit:
        raise InputError(f"`row`: above `limit`={limit:g} (give `limit`=NUMBER, or `other`=ROW)")
    warn(f"a row is below `limit`, `least`={least:g} was not needed; see `row` or `other`.")
    return row


@node
def doubted(row: Row, *, limit: float = 1.0) -> list[str]:
    """Sentences that go on as a value."""
    return [f"give `limit`={limit:g}"]


@node
def kept(row: Row, doubts: list[str], *, told: Provenance) -> None:
    """Keep what a result file would say."""
    TOLD[:] = [*told.warnings, *doubts]


NODES = rows, checked, doubted, kept
GRAPH: dict[str, Any] = {
    "format": 1,
    "params": {
        "how_many": {"kind": "integer", "default": 2},
        "source": {"kind": "path", "default": None},
        "ceiling": {"kind": "number", "default": 9.0},
    },
    "nodes": {
        "taken": {"op": "rows", "with": {"count": "$how_many", "file": "$source"}},
        "first": {"op": "checked", "in": {"row": "taken"}, "with": {"limit": "$ceiling"}},
        "why": {"op": "doubted", "in": {"row": "first"}, "with": {"limit": "$ceiling"}},
        "save": {"op": "kept", "in": {"row": "first", "doubts": "why"}},
    },
    "outputs": {"row": "first"},
}
OF_SOURCE = "row {}: how_many=2 rows; source is not read"
OF_ROW = (
    "a row is below ceiling, --set first.least=0 was not needed; see source or "
    "input 'other' of node 'first'."
)


def test_warnings_in_items_and_in_what_is_written(backend: str) -> None:
    graph = replace(read_graph(GRAPH), own=own_nodes(NODES))
    with open_pipeline(graph, {}, backend=backend) as pipeline:
        warned = [result.warnings for result in pipeline.items()]
    assert warned == [[OF_SOURCE.format(number), OF_ROW] for number in range(2)]
    assert [OF_SOURCE.format(1), OF_ROW, "give ceiling=9"] == TOLD


def test_errors_of_a_source_and_behind_it() -> None:
    assert refused(how_many=4) == "how_many=4: at most 3"
    line = "source: above ceiling=0.5 (give ceiling=NUMBER, or input 'other' of node 'first')"
    assert refused(ceiling=0.5) == line


def refused(**given: Any) -> str:
    with load(GRAPH, nodes=NODES, **given) as pipeline, pytest.raises(InputError) as raised:
        list(pipeline.items())
    return str(raised.value)


def test_cached_warnings_use_the_names_of_each_graph() -> None:
    other = {**GRAPH, "params": {**GRAPH["params"], "roof": {"kind": "number", "default": 9.0}}}
    other["nodes"] = {
        **GRAPH["nodes"],
        "first": {**GRAPH["nodes"]["first"], "with": {"limit": "$roof"}},
    }
    cache = Cache()
    for graph, name in ((GRAPH, "ceiling"), (other, "roof")):
        with load(graph, nodes=NODES, cache=cache) as pipeline:
            results = list(pipeline.items())
        assert [f"below {name}," in result.warnings[1] for result in results] == [True, True]
    assert all("first" in result.reused for result in results)


def test_a_function_called_by_itself_names_its_own_arguments() -> None:
    with collect_warnings([]) as told, pytest.raises(InputError, match=r"^`row`: above `limit`=9"):
        [checked(np.full(2, value, np.float32)) for value in (0, 10)]
    assert told[0].startswith("a row is below `limit`, ")


@pytest.mark.parametrize(
    ("graph", "task", "name", "feed"),
    [
        ("calibrate", "radius", "evidence.radius", "ball_radius_mm="),
        ("calibrate", "radius", "evidence.pixel", "pixel_size_mm="),
        ("calibrate", "square", "pixel", "pixel_size_mm="),
        ("calibrate", "rating", "flat", "flat="),
        ("calibrate", "film", "taken", "dark="),
        ("calibrate", "film", "dark", "dark="),
        ("calibrate", "rest_taken", "smooth_px", "--set rest_taken.smooth_px="),
        ("reconstruct", "take.sigma", "noise", "calibration="),
        ("reconstruct", "take.sigma", "image", "capture="),
        ("reconstruct", "take.sigma", "nothing", None),
    ],
)
def test_the_sources_of_parameters_in_shipped_graphs(
    graph: str, task: str, name: str, feed: str | None
) -> None:
    read = read_graph(graph)
    plan = make_plan(read, read.placeholders, device=None)
    assert feed_of(plan, plan.tasks[task], name) == feed
