"""``tactograph bench``: a user's own graph and values, node by node, and nothing written."""

import json
import re
from pathlib import Path

import pytest

from tactograph.graph.commands import bench
from tests.graph.conftest import STREAM, Command, Write, one_line

pytestmark = pytest.mark.usefixtures("toys")


@pytest.fixture
def graph(write: Write) -> str:
    return write(STREAM)


def test_every_step_of_an_item_is_timed_on_every_device(tactograph: Command, graph: str) -> None:
    done = tactograph("bench", graph, "count=2", "--repeats", "2")
    assert done.code == 0
    tables = done.out.split("items per second")[:-1]
    assert "numpy: 2 items" in tables[0]
    assert len(tables) > 1, "a device as well"
    for table in tables:
        steps = re.findall(r"│ ([\w. ]+?) +│ +(\w+) +│ +[\d.]+ │", table)
        assert {"light", "score"} <= {step for step, _ in steps}
        assert not {"frames", "cal", "save"} & {step for step, _ in steps}
    assert ("light", "opencl") in steps


def test_the_first_run_is_not_timed(tactograph: Command, toys: list[str], graph: str) -> None:
    tactograph("bench", graph, "count=2", "--backend", "numpy", "--repeats", "3")
    assert toys == ["at_rest", "touch 1", "touch 2"], "each item is read once, nothing is written"


def test_the_figures_of_one_back_end_can_be_written_to_a_file(
    tactograph: Command, graph: str, tmp_path: Path
) -> None:
    file = tmp_path / "bench.json"
    done = tactograph("bench", graph, "--backend", "numpy", "--repeats", "2", "--out", file)
    assert done.out.count("items per second") == 1
    assert "opencl" not in done.out
    (row,) = json.loads(file.read_text())
    assert [node["node"] for node in row["nodes"]] == ["light", "score"]
    assert f"an item {row['ms']:.2f} ms" in done.out
    assert row["ready_s"] > 0


def test_an_empty_stream_and_a_wrong_value_are_refused(tactograph: Command, graph: str) -> None:
    message = one_line(tactograph("bench", graph, "count=0", "--backend", "numpy"))
    assert "yielded nothing" in message
    assert "count" in one_line(tactograph("bench", graph, "cuont=2"))


@pytest.mark.slow
def test_simulators_are_left_out() -> None:
    places = bench._places(bench.RunOptions((), (), None, None, strict=False))
    assert not any("oclgrind" in str(place.device).lower() for place in places)
