"""Variants that this ring adds to graphs of others."""

import json
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError, load
from tactograph.graph.files.read_graph import read_graph, with_overlays
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.rings.mechanics.nodes.motion.read_touches import read_touches
from tests.fixtures import Calibration


def test_a_graphs_own_variant_goes_before_the_overlay_of_that_name() -> None:
    tracked = with_overlays(read_graph("live"), ["markers"])
    assert tracked.hash == read_graph("live_markers").hash
    assert "save_markers" not in tracked.nodes
    assert "save_markers" in read_graph("reconstruct_markers").nodes


@pytest.mark.parametrize(
    ("overlays", "node", "first"),
    [(["shear"], "force", "force"), (["force", "shear"], "tracks", "markers")],
)
def test_an_overlay_that_needs_another_names_it(overlays: list[str], node: str, first: str) -> None:
    graph = with_overlays(read_graph("reconstruct"), overlays)
    with pytest.raises(InputError, match=f"no node '{node}'; put --with {first} before"):
        open_pipeline(graph, {})


@pytest.mark.parametrize(
    ("graph", "arguments"),
    [
        ("reconstruct_pose", {}),
        ("reconstruct_markers", {}),
        ("precise_force", {"modulus_kpa": 100.0, "thickness_mm": 2.0}),
    ],
)
def test_nodes_for_plane_film_refuse_curved_film(
    graph: str, arguments: dict[str, float], calibration: Calibration, tmp_path: Path
) -> None:
    with np.load(calibration("near33")) as known:
        arrays = dict(known)
    arrays["rest"] = np.full(arrays["flat"].shape[1:], 0.1, np.float32)
    np.savez(tmp_path / "round.npz", **arrays)  # type: ignore[arg-type]
    with (
        load(graph, arguments, calibration=tmp_path / "round.npz") as pipeline,
        pytest.raises(InputError, match="no plane at rest"),
    ):
        pipeline(frames=arrays["flat"])


def test_touches_of_a_round_film_are_not_put_together(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        np.save(tmp_path / name / "height.npy", np.zeros((20, 30), np.float32))
        record = {"pixel_size_mm": 0.1, "metrics": {"rest_relief_mm": 3.0}}
        (tmp_path / name / "result.json").write_text(json.dumps(record))
    with pytest.raises(InputError, match="one: its film is no plane at rest"):
        read_touches(folder=tmp_path)
