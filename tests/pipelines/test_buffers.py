"""A steady stream of touches allocates nothing on the device after its first item."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import load
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tests.conftest import without_pictures

SIZE = {"width_px": 96, "height_px": 72, "pixel_size_mm": 0.25}


@pytest.fixture(scope="module")
def calibration(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a simulated ball, small and quick."""
    folder = tmp_path_factory.mktemp("small")
    made = {
        "simulate": {"radius_mm": 7.0, "seed": 1, "out": str(folder / "ball"), **SIZE},
        "simulate_flat": {"seed": 2, "out": str(folder / "flat"), **SIZE},
        "calibrate": {
            "capture": str(folder / "ball"),
            "flat": str(folder / "flat"),
            "ball_radius_mm": 7.0,
            "pixel_size_mm": 0.25,
            "out": str(folder / "cal.npz"),
        },
    }
    for graph, given in made.items():
        for _ in open_pipeline(without_pictures(read_graph(graph)), given).items():
            pass
    return folder / "cal.npz"


@pytest.mark.slow
@pytest.mark.parametrize("graph", ["paper", "reconstruct"])
def test_the_first_item_allocates_for_all(graph: str, calibration: Path) -> None:
    pipeline = load(graph, calibration=str(calibration), backend="opencl", force=True)
    rng = np.random.default_rng(3)
    counts = []
    for _ in range(30):
        pipeline(frames=rng.integers(60, 200, (4, 72, 96)).astype(np.uint8))
        counts.append(pipeline.buffers)
    assert counts[0] > 0
    assert set(counts) == {counts[0]}
