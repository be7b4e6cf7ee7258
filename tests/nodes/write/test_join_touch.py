"""A touch is joined once per graph, of what the graph has."""

from dataclasses import asdict
from pathlib import Path

import pytest

from tactograph.graph import GraphError
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.plan.draft import Draft, Value
from tactograph.graph.plan.names import bind
from tactograph.nodes.write.join_touch import CapturedFrames, View, join_touch

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


def test_every_part_is_where_its_name_says() -> None:
    records = {
        "frames": CapturedFrames("image", "name", "time", "state"),
        "view": View("lens", "camera"),
    }
    parts = {name: name for name in join_touch.input_names} | records
    joined = asdict(join_touch(**parts))
    assert joined == {name: name for name in joined}


def test_a_capture_has_a_name_and_no_time_but_a_camera_has_one(tmp_path: Path) -> None:
    reads = bound(GRAPH, tmp_path).tasks["touch"].reads
    assert reads["frames.name"] == Value("frames", "name")
    assert "frames.time" not in reads
    assert reads["view.camera"] == Value("cal", "camera")
    live = GRAPH.replace("read_capture, with: {folder", "read_camera, with: {calibration")
    assert bound(live, tmp_path).tasks["touch"].reads["frames.time"] == Value("frames", "time")


def test_what_gives_nothing_of_a_record_is_not_read_as_one(tmp_path: Path) -> None:
    with pytest.raises(GraphError, match=r"'view' takes a node that gives .* View \(lens, camera"):
        bound(GRAPH.replace("view: cal", "view: frames"), tmp_path)


@pytest.mark.parametrize(
    ("name", "now"), [("height", "height"), ("name", "frames"), ("camera", "view")]
)
def test_a_graph_that_gives_the_parts_to_a_writer_is_told_of_the_touch(
    tmp_path: Path, name: str, now: str
) -> None:
    text = GRAPH.replace("{touch: touch}", f"{{touch: touch, {name}: height}}")
    told = f"no input '{name}' any more: 'op: join_touch' takes it as '{now}', and this node takes"
    with pytest.raises(GraphError, match=told):
        bound(text, tmp_path)
