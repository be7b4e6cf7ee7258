"""Overlays and variants of graphs of streams."""

from pathlib import Path

import pytest

from tactograph.graph import InputError
from tactograph.graph.files.read_graph import read_graph, with_overlays
from tactograph.graph.plan.draft import Value
from tactograph.graph.plan.make_plan import make_plan
from tests.graph.files.test_compose import to_plan
from tests.nodes.write.test_join_touch import GRAPH, bound


def test_a_name_is_a_live_graph_with_overlays() -> None:
    for overlays in (["no_flat", "ros2"], ["reconstruct_no_shadow"]):
        name = "_".join(["live", *overlays])
        joined, laid = read_graph(name), with_overlays(read_graph("live"), overlays)
        assert (joined.name, joined.hash) == (name, laid.hash)
    previewed = with_overlays(read_graph("record"), ["preview"])
    assert previewed.title == "Live reconstruction, recorded, with a window"


def test_a_variant_with_a_base_lies_over_no_other_graph() -> None:
    with pytest.raises(InputError, match=r"variants.oneshot.base: a whole graph"):
        with_overlays(read_graph("live"), ["replay_oneshot"])


@pytest.mark.parametrize("overlay", ["preview", "rerun", "ros2", "record", "lerobot"])
@pytest.mark.parametrize("graph", ["live", "live_oneshot", "live_follow_drift", "live_markers"])
def test_the_viewers_fit_every_live_graph(graph: str, overlay: str) -> None:
    if (graph, overlay) == ("live_markers", "preview"):
        return  # it has one
    plan = make_plan(*to_plan(with_overlays(read_graph(graph), [overlay])), device=None)
    assert not plan.fallbacks


@pytest.mark.parametrize("graph", ["live", "replay", "ros2", "record"])
def test_the_drift_is_followed_in_every_graph_of_flashed_lights(graph: str) -> None:
    followed = with_overlays(read_graph(graph), ["follow_drift"])
    assert followed.entry("drift_2").inputs["before"] == "previous.relight.drift_2"
    make_plan(*to_plan(followed), device=None)


@pytest.mark.parametrize("overlay", ["recording", "topics", "camera", "from_lerobot"])
def test_a_source_fits_both_kinds_of_sensor(overlay: str) -> None:
    flashed = with_overlays(read_graph("reconstruct"), [overlay])
    colours = with_overlays(read_graph("gelsight_mini"), [overlay])
    assert flashed.entry("frames").op == colours.entry("frames").op != "read_capture"


def test_a_touch_of_a_camera_has_its_time(tmp_path: Path) -> None:
    live = GRAPH.replace("read_capture, with: {folder", "read_camera, with: {calibration")
    assert bound(live, tmp_path).tasks["touch"].reads["frames.time"] == Value("frames", "time")
