"""A groove whose walls light one another."""

import numpy as np
import pytest

from tactograph.graph import load
from tactograph.rings.shapes.nodes.shape_grating import shape_grating
from tests.fixtures import MadeOnce, Raytraced
from tests.pipelines.test_films import calibrate


@pytest.mark.slow
@pytest.mark.parametrize("wall_deg", [40.0, 30.0], ids=["narrow", "wide"])
def test_the_light_between_the_walls_of_a_groove(
    raytraced: Raytraced, made_once: MadeOnce, wall_deg: float
) -> None:
    """A rough height shows walls of two cells too flat: only a finer one throws all their light."""
    rig = raytraced / "hand_bounce"
    file = made_once("hand_bounce.npz", lambda file: calibrate(rig, file))
    size = {"width_px": 320, "height_px": 240, "pixel_size_mm": 1 / 14}
    wall = {"period_mm": 9.0, "duty": 2 / 3, "rise_mm": 0.5, "wall_deg": wall_deg}
    images = load("see_touch", calibration=file)(
        height=shape_grating(middle="groove", **size, **wall).height
    )

    def depth_um(**changes: dict[str, float]) -> float:
        pipeline = load("reconstruct", calibration=file, **changes)
        row = pipeline(frames=images["image"])["height"][70:170, 85:235].mean(axis=0)
        x = np.arange(row.size) - (row.size - 1) / 2
        level, bottom = (abs(x) > 35), (abs(x) < 10)
        line = np.polynomial.Polynomial.fit(x[level], row[level], 1)
        return 1e3 * float(np.mean(line(x[bottom]) - row[bottom]))

    assert depth_um() == pytest.approx(500, abs=4)
    assert depth_um(changes={"folded.folded_ratio": 100.0, "folded.narrow_ratio": 100.0}) < 495
