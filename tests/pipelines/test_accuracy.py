"""What the shipped graphs find, against the truth of captures by an independent renderer."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph.read import read_graph
from tactograph.graph.run import Result, open_pipeline

PIXEL_MM = {"far28": 1 / 14, "near33": 1 / 14, "far28_vga16": 1 / 28}


@cache
def calibration(rig: Path) -> Path:
    """One ball and the flat frame; the ball is found by itself."""
    import tempfile

    file = Path(tempfile.mkdtemp()) / f"{rig.name}.npz"
    run(
        "calibrate",
        file,
        capture=rig / "calibration",
        flat=rig / "flat",
        ball_radius_mm=7.0,
        pixel_size_mm=PIXEL_MM[rig.name],
    )
    return file


def run(graph: str, out: Path, backend: str | None = None, **given: object) -> Result:
    values = {name: str(v) if isinstance(v, Path) else v for name, v in given.items()}
    values["out"] = str(out)
    (result,) = open_pipeline(read_graph(graph), values, backend=backend).items()
    return result


def reconstruct(graph: str, rig: Path, shape: str, tmp_path: Path, backend: str | None = None):
    return run(graph, tmp_path, backend, capture=rig / shape, calibration=calibration(rig))


@pytest.mark.parametrize(("rig", "scale"), [("far28", 1), ("far28_vga16", 2)])
def test_shadow_handling_on_the_papers_hard_case(
    raytraced: Path, tmp_path: Path, rig: str, scale: int
) -> None:
    found = {
        graph: reconstruct(graph, raytraced / rig, "sphere", tmp_path)["metrics"]
        for graph in ("paper", "paper_no_shadow")
    }
    assert found["paper"]["peak_px"] == pytest.approx(70 * scale, abs=0.1)
    assert found["paper"]["max_error_px"] <= 11 * scale
    assert found["paper"]["over_10_percent"] <= 3
    without = found["paper_no_shadow"]
    assert found["paper"]["max_error_px"] < 0.75 * without["max_error_px"]
    assert found["paper"]["over_10_percent"] < 0.5 * without["over_10_percent"]


@pytest.mark.parametrize("shape", ["sphere_film", "cat_film"])
@pytest.mark.parametrize(("rig", "scale"), [("far28", 1), ("far28_vga16", 2)])
def test_soft_presses(raytraced: Path, tmp_path: Path, rig: str, scale: int, shape: str) -> None:
    found = reconstruct("reconstruct", raytraced / rig, shape, tmp_path)["metrics"]
    assert found["rmse_px"] <= 0.7 * scale


@pytest.mark.parametrize("graph", ["paper", "paper_no_shadow", "reconstruct"])
@pytest.mark.parametrize("rig", ["far28", "near33"])
def test_both_back_ends_find_the_same_height(
    raytraced: Path, tmp_path: Path, rig: str, graph: str
) -> None:
    host = reconstruct(graph, raytraced / rig, "cat_film", tmp_path / "a", "numpy")
    device = reconstruct(graph, raytraced / rig, "cat_film", tmp_path / "b", "opencl")
    assert not device.plan.fallbacks
    apart = np.abs(host["height"] - device["height"]) / PIXEL_MM[rig]
    flipped = np.abs(host["slope"] - device["slope"]).max(axis=0) > 1e-3
    assert flipped.mean() < 1e-3
    assert apart[~flipped].max() < 0.01


def test_a_touch_leaves_every_file_of_the_contract(raytraced: Path, tmp_path: Path) -> None:
    result = reconstruct("paper", raytraced / "far28", "sphere", tmp_path)
    names = {file.name for file in tmp_path.iterdir()}
    assert {
        "height.npy",
        "height.tiff",
        "height.ply",
        "height.png",
        "shadow.png",
        "shadow_view.png",
        "result.json",
    } == names
    assert np.array_equal(np.load(tmp_path / "height.npy"), result["height"])
