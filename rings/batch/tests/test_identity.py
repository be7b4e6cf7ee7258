"""A batch goes on only with what began it, and names what differs."""

from collections.abc import Callable
from pathlib import Path

import pytest

from rings.batch.tests.stores import job_of
from tactograph.graph.cache import result_origin
from tactograph.graph.cache.result_origin import find_origin
from tactograph.graph.errors import InputError
from tactograph.graph.files.read_graph import read_graph
from tactograph.rings.batch.batch import open_batch
from tactograph.rings.batch.worker import Worker
from tests.graph.cache.test_result_origin import GRAPH, plug_in
from tests.graph.conftest import Command, Write, one_line
from tests.nodes.capture.test_read_capture import IMAGES, write as write_images
from tests.nodes.files.test_sensor_identity import calibrated

__all__ = ["calibrated", "plug_in"]


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("code", r"other code \(felt\)"),
        ("version", r"other versions \(scipy\)"),
        ("file", r"other inputs \(made\.text\)"),
    ],
)
def test_a_batch_resumes_only_with_the_inputs_that_began_it(
    plug_in: Path, write: Write, monkeypatch: pytest.MonkeyPatch, what: str, message: str
) -> None:
    graph = read_graph(write(GRAPH))
    first, job = find_origin(graph, {}), job_of(graph, out="x.zarr")
    store = open_batch(job, first, ["a"], Worker(job))
    store._array("status")[:] = 1
    if what == "code":
        (plug_in / "felt/_deeper.py").write_text("TWO = 4")
    elif what == "version":
        monkeypatch.setattr(result_origin, "versions", lambda: {**first["versions"], "scipy": "99"})
    else:
        Path("made.txt").write_text("another")
    with pytest.raises(InputError, match=message):
        open_batch(job, find_origin(graph, {}), ["a", "b"], Worker(job))


LIT = """
format: 1
title: The first light
params:
  capture:     {kind: path}
  calibration: {kind: path}
prefer: [numpy]
nodes:
  frames: {op: read_capture, with: {folder: $capture, calibration: $calibration}}
  lit:    {op: label_lit, in: {light: frames.image}}
outputs: {lit: lit}
"""


def test_a_store_of_another_sensor_is_refused_by_both_names(
    tmp_path: Path, calibrated: Callable[..., Path], tactograph: Command
) -> None:
    write_images(tmp_path / "touches" / "1", IMAGES)
    graph, used, store = (tmp_path / name for name in ("first.yaml", "used.npz", "all.zarr"))
    graph.write_text(LIT)
    words = ("batch", graph, f"calibration={used}", "--out", store)
    words += ("--over", tmp_path / "touches" / "*")
    calibrated("left").replace(used)
    assert tactograph(*words).code == 0
    shown = tactograph("show", store).out
    assert "calibration: hash" in shown
    assert "sensor left, date 20" in shown
    calibrated("right").replace(used)
    message = one_line(tactograph(*words))
    assert "other inputs (calibration), for sensor 'left' and not 'right'" in message
