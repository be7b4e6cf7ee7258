"""Film that does not fill the frame: round views, housings, black frames."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.pipelines import matt_film
from tests.pipelines.matt_film import BALL, BALL_MM, FLAT, PIXEL_MM, TOUCH, Image, run, write

ROWS, COLUMNS = np.mgrid[:120, :160]
VIEWS = {
    "all film": np.ones((120, 160), bool),
    "a round view": np.hypot(COLUMNS - 79.5, ROWS - 59.5) < 58,
    "a black frame": np.pad(np.ones((84, 136), bool), ((18, 18), (12, 12))),
}


def taken(height: matt_film.F4, seen: NDArray[np.bool_], seed: int) -> Image:
    """What the camera sees: film in one part of the frame, and black housing in the other."""
    film = matt_film.taken(height, seed)
    housing = np.random.default_rng(seed).normal(2, 0.6, film.shape).clip(0, 255)
    return np.where(seen, film, np.rint(housing)).astype(np.uint8)


@pytest.fixture(scope="module", params=VIEWS)
def view(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with captures and a calibration."""
    folder, seen = tmp_path_factory.mktemp("view"), VIEWS[request.param]
    for seed, (name, height) in enumerate({"flat": FLAT, "ball": BALL, "touch": TOUCH}.items()):
        write(folder / name, taken(height, seen, seed))
    np.save(folder / "seen.npy", seen)
    given = {"capture": str(folder / "ball"), "flat": str(folder / "flat")}
    scale = {"ball_radius_mm": BALL_MM, "pixel_size_mm": PIXEL_MM}
    result = run("calibrate", **given, **scale, out=str(folder / "cal.npz"))
    told = [line for line in matt_film.said(result) if "fills" in line]
    assert bool(told) == (not seen.all())
    assert matt_film.said(result) == told
    return folder


def test_the_edge_of_the_film_is_drawn(view: Path) -> None:
    picture = cv2.imread(str(view / "cal.png"))
    part = picture[: picture.shape[0] // 2, : picture.shape[1] // 2].astype(int)
    blue = (part[..., 0] > 180) & (part[..., 2] < 100)
    assert bool(blue.sum() > 50) == (not np.load(view / "seen.npy").all())


@pytest.mark.parametrize("graph", ["reconstruct", "precise", "paper"])
def test_what_is_no_film_changes_no_height(view: Path, graph: str) -> None:
    given = {"capture": str(view / "touch"), "calibration": str(view / "cal.npz")}
    result = run(graph, sinks=False, **given)
    seen = np.load(view / "seen.npy")
    off = (result["height"] - TOUCH)[seen]
    assert np.sqrt(np.mean(off**2)) < (0.03 if graph == "paper" else 0.012)
    assert np.abs(result["height"][~seen]).max(initial=0) < 0.05
    assert not [line for line in result.warnings if "may be wrong" in line]
