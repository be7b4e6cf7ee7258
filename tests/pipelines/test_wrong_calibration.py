"""A wrong calibration is refused; one that is forced is doubtful wherever it is used."""

import re
from pathlib import Path

import pytest

from tactograph.graph import InputError
from tactograph.graph.files.read_graph import read_graph, shipped_names
from tactograph.graph.run.result import Result
from tests.each import each
from tests.fixtures import RIG_PIXEL_MM, SHARED, Raytraced, images_of
from tests.pipelines.conftest import Reconstruct, run

RIG = "near33"
SEVEN = r"(7|6\.9[5-9]|7\.0[1-5])"
"""The radius of the ball in mm, as the light gives it."""


def calibrate(rig: Path, out: Path, **params: object) -> Result:
    """Calibrate with the diameter of the ball, 14 mm, for its radius."""
    return run("calibrate", out, **images_of(rig) | {"ball_radius_mm": 14.0, **params})


@pytest.mark.slow
def test_a_diameter_typed_as_radius_writes_no_file(raytraced: Raytraced, tmp_path: Path) -> None:
    file = tmp_path / "cal.npz"
    with pytest.raises(InputError, match=f"a ball of {SEVEN} mm radius explains the light better"):
        calibrate(raytraced / RIG, file)
    assert not file.exists()


@pytest.mark.slow
def test_a_pixel_size_in_another_unit_is_named(raytraced: Raytraced, tmp_path: Path) -> None:
    """Ten times too small, it ended with tables that no sensor has."""
    values = {"ball_radius_mm": 7.0, "pixel_size_mm": RIG_PIXEL_MM[RIG] / 10}
    words = r"a ball of 0\.(69|7)\d* mm radius explains .* in another unit"
    with pytest.raises(InputError, match=words):
        run("calibrate", tmp_path / "cal.npz", **images_of(raytraced / RIG) | values)


@pytest.mark.slow
def test_a_forced_calibration_is_doubtful_also_at_use(raytraced: Raytraced, tmp_path: Path) -> None:
    file = tmp_path / "cal.npz"
    result = calibrate(raytraced / RIG, file, accept_contradictions=True, led_distance_mm=55.0)
    assert re.match(f"doubtful: a ball of {SEVEN} mm radius", result.outputs["verdict"])
    assert result.outputs["advice"].startswith("settle the doubts first")
    assert any(re.search(f"ball_radius_mm={SEVEN} would agree", each) for each in result.warnings)
    used = run("reconstruct", capture=raytraced / RIG / "sphere_film", calibration=file)
    assert [w for w in used.warnings if w.startswith(f"calibration {file} is doubtful")]


@pytest.mark.slow
def test_a_wrong_pixel_size_that_other_parts_of_the_film_compensate_is_reported(
    raytraced: Raytraced, tmp_path: Path
) -> None:
    wrong = {"ball_radius_mm": 7.0, "pixel_size_mm": 1.03 * RIG_PIXEL_MM["far28"]}
    result = calibrate(raytraced / "far28", tmp_path / "cal.npz", **wrong)
    assert re.search(r"gel diffuses \d% of the light", result.outputs["verdict"])


@pytest.mark.slow
def test_an_unstated_near_camera_does_not_make_the_radius_doubtful(tmp_path: Path) -> None:
    """The fit once ended in a bad minimum, where 5.73 mm seemed to explain more."""
    rig = SHARED / "raytraced" / "hand"
    if not rig.is_dir():
        pytest.skip("needs the ray-traced sensor in the hand")
    params = {"capture": rig / "calibration", "flat": rig / "flat", "ball_radius_mm": 6.0}
    result = run("calibrate", tmp_path / "cal.npz", **params, pixel_size_mm=1 / 14)
    assert not [warning for warning in result.warnings if "explains the light better" in warning]


def test_a_right_calibration_is_used_without_a_warning(reconstruct: Reconstruct) -> None:
    used = reconstruct("reconstruct", RIG, "sphere_film")
    assert not any("doubtful" in warning for warning in used.warnings)


READERS = {
    "read_calibration": "file",
    "read_press_calibration": "file",
    "read_rest_height": "calibration",
}
"""Nodes that read a calibration, and their param that names it."""
REPLAYING = {"stitch", "rank_checks", "certify"}
"""Graphs that read it through another graph and repeat its doubts, or that make no touch."""


@each("name", sorted({*shipped_names()} - REPLAYING))
def test_every_graph_that_uses_a_calibration_repeats_its_doubts(name: str) -> None:
    graph = read_graph(name)
    if "calibration" in graph.params:
        readers = [entry for entry in graph.nodes.values() if entry.op in READERS]
        assert [entry.settings[READERS[entry.op]] for entry in readers] == ["$calibration"]
