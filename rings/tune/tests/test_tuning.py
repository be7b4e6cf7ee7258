"""The state behind the page: the latest change wins, a bad one changes nothing."""

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rings.tune.tests.conftest import GRAPH, Open, settled
from tactograph.graph import InputError
from tactograph.graph.files.read_graph import read_graph
from tactograph.rings.tune.tuning import Tuning
from tests.graph.conftest import Write


def test_a_change_is_followed_by_its_result(tuning: Tuning, toys: list[str]) -> None:
    before = settled(tuning)
    assert before.result["high"].size == 20
    tuning.set("high", "above", 5.0)
    after = settled(tuning)
    assert after.result["high"].size == 0
    assert toys.count("doubled") == 1


GROUPED = """
format: 1
params: {count: {kind: integer, default: 3}}
groups:
  cut:
    inputs:  {image: {}}
    nodes:   {high: {op: bright, in: {image: image}}}
    outputs: {light: high.light}
nodes:
  frames: {op: touches, with: {count: $count}}
  one:    {group: cut, in: {image: frames.image}}
  twice:  {op: doubled, in: {image: frames.image}}
  two:    {group: cut, in: {image: twice}}
outputs: {one: one.light, two: two.light}
"""


def test_a_node_of_a_group_is_changed_in_one_use_or_in_every(opened: Open, tmp_path: Path) -> None:
    tuning = opened(GROUPED)

    def lit() -> tuple[int, int]:
        result = settled(tuning).result
        return result["one"].size, result["two"].size

    assert lit() == (0, 20)
    tuning.set("two.high", "above", 5.0)
    assert lit() == (0, 0)
    tuning.every = True
    tuning.set("one.high", "above", 0.5)
    assert lit() == (20, 20)
    assert tuning.changes() == [{"set": "cut.high", "with": {"above": 0.5}}]
    saved = read_graph(tuning.save(tmp_path / "kept.yaml"))
    assert saved.nodes == tuning.graph.nodes
    tuning.set_backend("two.high", "numpy")
    assert {entry.backend for entry in tuning.graph.nodes.values()} == {None, "numpy"}
    tuning.reset("two.high")
    assert tuning.changes() == []
    assert lit() == (0, 20)


def test_the_latest_of_many_changes_is_shown(tuning: Tuning) -> None:
    first = settled(tuning).number
    for value in np.linspace(0, 9, 400):
        tuning.set("high", "above", float(value))
    state = settled(tuning)
    assert state.request.graph.nodes["high"].settings["above"] == 9.0
    assert state.number - first < 400


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.set("high", "above", "much"), "a number is needed, not 'much'"),
        (lambda t: t.set("hihg", "above", 1.0), "there is no node 'hihg'; did you mean 'high'"),
        (lambda t: t.set("high", "abov", 1.0), "has no parameter 'abov'"),
        (lambda t: t.set_backend("twice", "opencl"), "'doubled' has no OpenCL kernel"),
        (lambda t: t.set_neutral("twice", True), "'doubled' has no neutral value"),
        (lambda t: t.save(Path("v.yaml")), "nothing was changed"),
    ],
)
def test_an_impossible_change_is_refused_and_changes_nothing(
    tuning: Tuning, change: Callable[[Tuning], None], message: str
) -> None:
    before = settled(tuning)
    with pytest.raises(InputError, match=message):
        change(tuning)
    assert settled(tuning) is before


def test_a_failing_node_is_reported_and_the_next_change_mends_it(tuning: Tuning) -> None:
    good = settled(tuning).result
    tuning.set("fail", "at", 2.0)
    state = settled(tuning)
    assert "'fail'" in state.error
    assert state.result is good
    tuning.set("fail", "at", 50.0)
    assert settled(tuning).error == ""


def test_a_node_can_be_looked_into(tuning: Tuning) -> None:
    tuning.look_at("twice")
    assert (settled(tuning).inspected["doubled"] == np.full((3, 4, 5), 2)).all()


def test_a_back_end_is_switched_and_taken_back(tuning: Tuning) -> None:
    tuning.set_backend("high", "numpy")
    assert settled(tuning).result.plan.placements["high"].backend == "numpy"
    assert tuning.changes() == [{"backend": "high", "to": "numpy"}]
    tuning.set_backend("high", None)
    assert settled(tuning).result.plan.placements["high"].backend == "opencl"
    assert tuning.changes() == []


def test_reset_takes_the_file_s_word(tuning: Tuning) -> None:
    for node, param in (("fail", "at"), ("high", "above")):
        tuning.set(node, param, 7.0)
        tuning.reset(node)
    assert settled(tuning).result["high"].size == 20
    assert tuning.changes() == []


def test_a_missing_capture_is_refused_before_a_page_opens(tmp_path: Path) -> None:
    (tmp_path / "touches").mkdir()
    with pytest.raises(InputError, match=r"capture=.*there is no such folder.*mean 'touches'"):
        Tuning("reconstruct", {"capture": str(tmp_path / "touchs"), "calibration": "cal.npz"})


def test_a_stream_continues_and_ends(tuning: Tuning) -> None:
    for level in (2, 4, 6):
        assert settled(tuning).result["light"][0, 0, 0] == level
        tuning.go(1)
    assert "its stream has ended" in settled(tuning).error


def test_a_step_forward_counts_from_where_a_playing_stream_is(tuning: Tuning) -> None:
    step = threading.Thread(target=tuning.go, args=(1,))
    with tuning._changed:
        step.start()
        step.join(0.2)
        tuning.go(1)
    step.join()
    assert tuning.request.item == 2


def test_a_stream_runs_while_its_parameters_change(opened: Open) -> None:
    tuning = opened(GRAPH.replace("default: 3", "default: 5000"))
    settled(tuning)
    tuning.play(True)
    for value in (1.0, 2.0, 3.0):
        before, end = tuning.request.item, time.monotonic() + 60
        tuning.set("high", "above", value)
        while tuning.request.item < before + 2:
            assert time.monotonic() < end, "the stream stands"
            time.sleep(0.01)
    tuning.play(False)
    assert settled(tuning).error == ""
    assert tuning.request.item > 3


def test_a_saved_graph_reads_back_as_shown(tuning: Tuning, tmp_path: Path) -> None:
    tuning.set("high", "above", 5.0)
    tuning.set_backend("high", "numpy")
    file = tuning.save(tmp_path / "sub" / "kept.yaml")
    assert read_graph(file).nodes == tuning.graph.nodes
    assert len(file.read_text().splitlines()) == 8


def test_a_foreign_file_is_not_replaced(tuning: Tuning, tmp_path: Path) -> None:
    tuning.set("high", "above", 5.0)
    theirs = tmp_path / "theirs.yaml"
    theirs.write_text("site_name: of others\n")
    with pytest.raises(InputError, match="is there already"):
        tuning.save(theirs)
    assert theirs.read_text() == "site_name: of others\n"


def test_a_file_that_was_saved_here_is_saved_again_unless_it_was_changed_since(
    tuning: Tuning, tmp_path: Path
) -> None:
    file = tmp_path / "kept.yaml"
    for above in (5.0, 6.0):
        tuning.set("high", "above", above)
        tuning.save(file)
    file.write_text(file.read_text() + "# a note by hand\n")
    with pytest.raises(InputError, match="is there already"):
        tuning.save(file)


def test_no_graph_is_replaced_by_its_extension(opened: Open, write: Write, tmp_path: Path) -> None:
    base = Path(write(GRAPH, "base.yaml"))
    tuning = opened("format: 1\nextends: base.yaml\n")
    tuning.set("high", "above", 5.0)
    for file in (base, Path(tuning.source), tmp_path / "." / "base.yaml"):
        with pytest.raises(InputError, match="is the graph that is tuned, or extended"):
            tuning.save(file)
    assert base.read_text() == GRAPH


def test_the_file_is_read_again_and_a_mistake_keeps_the_last_good_graph(tuning: Tuning) -> None:
    tuning.set("high", "above", 5.0)
    good = settled(tuning)
    file = Path(tuning.source)
    later = time.time() + 5
    file.write_text(GRAPH.replace("op: bright", "op: brigth"))
    os.utime(file, (later, later))
    assert tuning.reload()
    assert "graph.yaml:8:" in tuning.state.error
    assert "did you mean 'bright'" in tuning.state.error
    assert tuning.state.result is good.result
    tuning.set("high", "above", 6.0)
    assert "graph.yaml:8:" in settled(tuning).error, "a result that ends later hides no mistake"
    file.write_text(GRAPH.replace("{at: 99}", "{at: 98}"))
    os.utime(file, (later + 5, later + 5))
    assert tuning.reload()
    state = settled(tuning)
    assert (state.error, tuning.graph.nodes["fail"].settings) == ("", {"at": 98})
    assert not tuning.reload()
