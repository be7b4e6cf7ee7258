"""The resources that touches need: loaded libraries and buffers of the device."""

from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import load
from tactograph.nodes.calibrate.ranks.rank_checks import rank_checks
from tests.fixtures import python, simulated_sensor

SIZE = {"width_px": 96, "height_px": 72, "pixel_size_mm": 0.25}


@pytest.fixture(scope="module")
def calibration(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The calibration of a small simulated sensor whose touches are judged."""
    small = simulated_sensor(tmp_path_factory.mktemp("small"), radius_mm=7.0, ranked=False, **SIZE)
    rank_checks(file=small / "cal.npz", count=10)
    return small / "cal.npz"


@pytest.mark.slow
@pytest.mark.parametrize("graph", ["paper", "reconstruct"])
def test_the_first_item_allocates_for_all(graph: str, calibration: Path) -> None:
    pipeline = load(
        graph, calibration=str(calibration), backend="opencl", accept_contradictions=True
    )
    rng = np.random.default_rng(3)
    counts = []
    for _ in range(30):
        pipeline(frames=rng.integers(60, 200, (4, 72, 96)).astype(np.uint8))
        counts.append(pipeline.buffers)
    assert counts[0] > 0
    assert set(counts) == {counts[0]}


@pytest.mark.parametrize("backend", ["opencl", "numpy"])
def test_a_height_loads_no_library_that_only_pictures_and_curved_films_need(
    calibration: Path, backend: str
) -> None:
    """Each of them takes 7 to 60 MB, and a tenth of the start or more."""
    heavy = {"matplotlib", "scipy", "rich", "jinja2"}
    code = (
        "import sys, numpy as np\n"
        "from tactograph import load\n"
        f"p = load('reconstruct', calibration={str(calibration)!r}, backend={backend!r}, "
        "accept_contradictions=True)\n"
        "p(frames=np.full((4, 72, 96), 128, np.uint8))\n"
        f"print(sorted({heavy} & set(sys.modules)))"
    )
    assert python("-c", code).stdout.splitlines()[-1] == "[]"
