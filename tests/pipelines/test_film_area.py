"""Film that does not fill the frame: round views, housings, black frames."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.pipelines.matt_film import TOUCH, Image, calibrated, run, see, warnings_of

ROWS, COLUMNS = np.mgrid[:120, :160]
VIEWS = {
    "a round view": np.hypot(COLUMNS - 79.5, ROWS - 59.5) < 58,
    "all film": np.ones((120, 160), bool),
    "a black frame": np.pad(np.ones((84, 136), bool), ((18, 18), (12, 12))),
}


def housed(film: Image, visible: NDArray[np.bool_]) -> Image:
    """An image with film in one part of the frame, and black housing in the other."""
    housing = np.random.default_rng(film.sum()).normal(2, 0.6, film.shape).clip(0, 255)
    return np.where(visible, film, np.rint(housing)).astype(np.uint8)


@pytest.fixture(scope="module", params=VIEWS)
def view(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with captures and a calibration."""
    folder, visible = tmp_path_factory.mktemp("view"), VIEWS[request.param]
    see(folder, lambda film: housed(film, visible))
    np.save(folder / "visible.npy", visible)
    warnings = warnings_of(calibrated(folder, searched=True))
    assert ["fills" in line for line in warnings] == ([] if visible.all() else [True])
    return folder


@pytest.mark.one_case
def test_the_edge_of_the_film_is_drawn(view: Path) -> None:
    picture = cv2.imread(str(view / "cal.png"))
    part = picture[: picture.shape[0] // 2, : picture.shape[1] // 2].astype(int)
    blue = (part[..., 0] > 180) & (part[..., 2] < 100)
    assert bool(blue.sum() > 50) == (not np.load(view / "visible.npy").all())


@pytest.mark.one_case
@pytest.mark.parametrize("graph", ["reconstruct", "precise", "paper"])
def test_parts_without_film_change_no_height(view: Path, graph: str) -> None:
    params = {"capture": str(view / "touch"), "calibration": str(view / "cal.npz")}
    result = run(graph, sinks=False, **params)
    visible = np.load(view / "visible.npy")
    off = (result["height"] - TOUCH)[visible]
    assert np.sqrt(np.mean(off**2)) < (0.03 if graph == "paper" else 0.012)
    assert np.abs(result["height"][~visible]).max(initial=0) < 0.05
    assert not [line for line in result.warnings if "may be wrong" in line]
