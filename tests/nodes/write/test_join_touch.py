"""A graph joins its values into one touch."""

from pathlib import Path

import pytest

from tactograph.graph import GraphError
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.plan.draft import Draft, Value
from tactograph.graph.plan.names import bind
from tactograph.nodes.optics.camera_view import View
from tactograph.nodes.stream.touch import Touch
from tactograph.nodes.write.join_touch import CapturedFrames, join_touch

GRAPH = """
format: 1
params:
  folder: {kind: path, default: captures}
nodes:
  frames: {op: read_capture, with: {folder: $folder}}
  height: {op: read_height, with: {file: $folder}}
  pixel:  {op: pixel_size, with: {mm: 0.1}}
  cal:    {op: read_calibration, with: {file: $folder}}
  touch:
    op: join_touch
    in: {height: height, pixel: pixel, frames: frames, view: cal}
  save: {op: write_result, in: {touch: touch}, with: {folder: $folder}}
"""


def bound(text: str, folder: Path) -> Draft:
    file = folder / "graph.yaml"
    file.write_text(text)
    graph = read_graph(str(file))
    return bind(graph, graph.placeholders, sinks=True, stand_ins=frozenset())


def test_every_part_is_stored_under_its_name() -> None:
    frames, view = CapturedFrames("image", "name", 1.0, "state"), View("lens", "camera")
    layers = {"shadow": "shadow", "error": None, "pose": "pose"}
    touch = join_touch("height", "pixel", frames, "metrics", view, **layers)
    known = {"shadow": "shadow", "pose": "pose"}
    assert touch == Touch("height", "image", "pixel", "name", 1.0, "state", view, "metrics", known)


def test_a_capture_has_a_name_and_no_time(tmp_path: Path) -> None:
    reads = bound(GRAPH, tmp_path).tasks["touch"].reads
    assert reads["frames.name"] == Value("frames", "name")
    assert "frames.time" not in reads
    assert reads["view.camera"] == Value("cal", "camera")


def test_a_node_that_gives_nothing_of_a_record_is_refused(tmp_path: Path) -> None:
    with pytest.raises(GraphError, match=r"'view' takes a node that gives .* View \(lens, camera"):
        bound(GRAPH.replace("view: cal", "view: frames"), tmp_path)


def test_layers_are_taken_by_name_with_the_types_of_their_kinds(tmp_path: Path) -> None:
    graph = GRAPH.replace("view: cal}", "view: cal, error: height, shadow: frames.truth_shadow}")
    task = bound(graph, tmp_path).tasks["touch"]
    assert task.reads["error"] == Value("height", "read_height")
    assert task.node.inputs["shadow"].unit == "LED bits"
    assert task.node.inputs["shadow"].optional


def test_an_unknown_layer_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    message = r"no input 'shadw'; did you mean 'shadow'\? \(it takes: .*error, .*shadow"
    with pytest.raises(GraphError, match=message):
        bound(GRAPH.replace("view: cal}", "view: cal, shadw: height}"), tmp_path)
