"""Calibrations without a ball: from the places of the lamps, or their directions."""

from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.graph.files.read_graph import read_graph
from tactograph.nodes import Film
from tactograph.rings.without_ball.nodes.find_highlights import find_highlights
from tactograph.rings.without_ball.nodes.model_tables import model_tables
from tests.fixtures import few_ranks
from tests.pipelines.matt_film import (
    BALL,
    FLAT,
    PIXEL_MM,
    TOUCH,
    leds,
    run,
    taken,
    warnings_of,
    write,
)

NEAR, FAR = leds(4), leds(4, distance_mm=1000.0)


def table(file: Path, lamps: np.ndarray, names: bool = True) -> str:
    rows = [f"led{k},{x},{y},{z}" for k, (x, y, z) in enumerate(lamps, start=1)]
    file.write_text("\n".join(["lamp,x,y,z", *rows]) + "\n")
    return str(file)


def dome(file: Path, lamps: np.ndarray) -> str:
    """As programs for light domes write it: y points up."""
    unit = lamps / np.linalg.norm(lamps, axis=1, keepdims=True)
    rows = [rf"C:\some dome\led{k}.jpg {x} {-y} {z}" for k, (x, y, z) in enumerate(unit, start=1)]
    file.write_text("\n".join([str(len(lamps)), *reversed(rows)]) + "\n")
    return str(file)


def calibrated(folder: Path, lights: str, lamps: np.ndarray) -> object:
    flat = write(folder / "flat", taken(FLAT, 0, lamps))
    out = str(folder / "cal.npz")
    graph = few_ranks(read_graph("calibrate_lights"))
    return run(graph, lights=lights, flat=flat, pixel_size_mm=PIXEL_MM, out=out)


def error(folder: Path, lamps: np.ndarray, graph: str = "reconstruct") -> float:
    """Root mean square error in mm of a touch without warnings."""
    touch = write(folder / "touch", taken(TOUCH, 1, lamps))
    result = run(graph, capture=touch, calibration=str(folder / "cal.npz"), sinks=False)
    assert warnings_of(result) == []
    return float(np.sqrt(np.mean((result["height"] - TOUCH) ** 2)))


@pytest.mark.one_case
@pytest.mark.parametrize("graph", ["reconstruct", "precise", "paper"])
def test_near_lamps_give_heights_in_mm(tmp_path: Path, graph: str) -> None:
    result = calibrated(tmp_path, table(tmp_path / "leds.csv", NEAR), NEAR)
    assert warnings_of(result) == []
    assert result["quality"]["flat_residual_percent"] < 1
    assert error(tmp_path, NEAR, graph) < (0.06 if graph == "paper" else 0.012)


def test_a_light_dome_gives_the_shape(tmp_path: Path) -> None:
    result = calibrated(tmp_path, dome(tmp_path / "lamps.lp", FAR), FAR)
    assert warnings_of(result) == ["only the lamps' directions are known: they count as far away"]
    assert error(tmp_path, FAR) < 0.012


def mirror(lamps: np.ndarray, center: tuple[float, float], radius: float) -> np.ndarray:
    """A black ball that mirrors small lamps, and a window that is in all images."""
    y, x = np.indices((120, 160))
    nx, ny = (x - center[0]) / radius, (y - center[1]) / radius
    inside = nx**2 + ny**2 < 1
    nz = np.sqrt(np.where(inside, 1 - nx**2 - ny**2, 0))
    seen = np.stack([2 * nz * nx, 2 * nz * ny, 2 * nz * nz - 1])
    away = lamps / np.linalg.norm(lamps, axis=1, keepdims=True)
    glints = np.exp((np.tensordot(away, seen, axes=1) - 1) / 0.002)
    window = np.exp((np.tensordot([0.0, -0.8, 0.6], seen, axes=1) - 1) / 0.01)
    return np.uint8(np.clip(inside * (230 * glints + 120 * window), 0, 255))


@pytest.mark.slow
def test_a_mirror_ball_tells_where_lamps_are(tmp_path: Path) -> None:
    center, radius = (71.0, 64.5), 45.0
    images = {"capture": write(tmp_path / "mirror", mirror(FAR, center, radius))}
    images["flat"] = write(tmp_path / "flat", taken(FLAT, 0, FAR))
    arguments = {"ball_center_px": center, "ball_radius_px": radius, "pixel_size_mm": PIXEL_MM}
    out = str(tmp_path / "cal.npz")
    found = run("calibrate_lights_mirror", **images, **arguments, out=out)["lights"]
    found, true = (at / np.linalg.norm(at, axis=1, keepdims=True) for at in (found, FAR))
    assert np.degrees(np.arccos((found * true).sum(axis=1).clip(-1, 1))).max() < 0.5
    assert error(tmp_path, FAR) < 0.015


@pytest.mark.slow
def test_lamps_suffice_where_no_film_at_rest_was_taken(tmp_path: Path) -> None:
    touch = write(tmp_path / "first", taken(TOUCH, 2, FAR))
    arguments = {"lights": dome(tmp_path / "lamps.lp", FAR), "pixel_size_mm": PIXEL_MM}
    made = run("calibrate_lights_no_flat", **arguments, touch=touch, out=str(tmp_path / "cal.npz"))
    assert any(note.startswith("no flat frame was given") for note in warnings_of(made))
    assert error(tmp_path, FAR, "reconstruct_no_flat") < 0.03


def test_tables_have_the_noise_of_the_camera_where_no_film_at_rest_was_taken() -> None:
    """Light of full scale stands for a flat frame that was not taken, and counted as saturated."""
    film, noise = Film.matt(FAR), np.array([1e-5, 1e-6], np.float32)
    taken, none = (
        model_tables(film, np.full((4, 8, 8), level, np.float32), noise) for level in (0.99, 1.0)
    )
    assert none.light == pytest.approx(taken.light, abs=1e-3)


def test_a_mirror_ball_is_not_a_film(tmp_path: Path) -> None:
    ball = write(tmp_path / "mirror", mirror(FAR, (71.0, 64.5), 20.0))
    with pytest.raises(InputError, match=r"too dark to measure.*calibrate_lights_mirror"):
        run("calibrate", capture=ball, ball_radius_mm=4.0, pixel_size_mm=PIXEL_MM)


def test_a_ball_without_highlights_is_refused(tmp_path: Path) -> None:
    ball = write(tmp_path / "dull", taken(TOUCH, 1, NEAR))
    with pytest.raises(InputError, match="LED 1 makes no highlight on the ball"):
        find_highlights(folder=Path(ball), center_px=(80.0, 60.0), radius_px=50.0)


WRONG = {
    "holds no lamp": "x,y,z\n",
    "leds.csv:2: a lamp's line ends in x, y, z": "0,0,10\n1,2,ten\n",
    "has 3 lamps, but .* an image of LED 4": "1,0,9\n0,1,9\n-1,0,9\n",
    "the lamp of LED 2 is not above the film": "9,0,9\n0,9,-9\n-9,0,9\n0,-9,9\n",
    "directions of length 1 and places in mm": "9,0,9\n0,0.6,0.8\n-9,0,9\n0,-9,9\n",
    "fits the lamps in the order 2, 1, 3, 4": "\n".join(
        " ".join(map(str, lamp)) for lamp in NEAR[[1, 0, 2, 3]]
    ),
    r"directions of length 30.* into a \.csv": "4\n" + "".join(f"a{k} 1 2 30\n" for k in range(4)),
}


@pytest.mark.parametrize("message", WRONG)
def test_wrong_lamps_are_refused(tmp_path: Path, message: str) -> None:
    file = tmp_path / ("lamps.lp" if "into a" in message else "leds.csv")
    file.write_text(WRONG[message])
    with pytest.raises(InputError, match=message):
        calibrated(tmp_path, str(file), NEAR)


@pytest.mark.parametrize(
    ("height", "doubt"),
    [(TOUCH, ""), (-TOUCH, "up to the camera is positive"), (BALL, "object's height")],
    ids=["right", "upside down", "another object"],
)
def test_a_known_shape_that_is_another_is_doubted(
    tmp_path: Path, height: np.ndarray, doubt: str
) -> None:
    """Film at rest hid it: with the height of a cat for a ball nothing spoke against the file."""
    images = {"flat": FLAT, "touch": TOUCH}
    folders = {name: write(tmp_path / name, taken(z, 0, NEAR)) for name, z in images.items()}
    np.save(tmp_path / "shape.npy", height)
    found = run(
        few_ranks(read_graph("calibrate_known_shape")),
        capture=folders["touch"], flat=folders["flat"], height=str(tmp_path / "shape.npy"),
        pixel_size_mm=PIXEL_MM, out=str(tmp_path / "cal.npz"),
    )  # fmt: skip
    assert bool(warnings_of(found)) == bool(doubt)
    assert any(doubt in warning for warning in warnings_of(found)) == bool(doubt)
