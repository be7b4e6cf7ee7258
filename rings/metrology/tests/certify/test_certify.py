"""The whole verb, on a sensor that is rendered on thirds of its pixels."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from benchmarks.one_run import run
from tactograph.graph import InputError, load
from tactograph.nodes import F4, F8
from tactograph.nodes.simulate.expose import expose
from tactograph.rings.metrology.nodes.certify._sensor import certified_sensor
from tactograph.rings.metrology.nodes.certify.draw_ripples import draw_ripples
from tactograph.rings.metrology.nodes.certify.measure_touches import measure_touches
from tactograph.rings.metrology.nodes.certify.transfer_function import transfer_function
from tests.fixtures import Calibration, Raytraced, python

PIXEL_MM, ROWS, COLUMNS, PARTS = 1 / 14, 180, 240, 3
BLUR_PX, RADIUS_MM = 0.8, 6.0
MOST_OFF = 0.05
"""Of a wave whose height comes through by half, between model and rendered truth."""
SIDE_MM = PIXEL_MM / PARTS
Y, X = SIDE_MM * (
    np.indices((PARTS * ROWS, PARTS * COLUMNS))
    - (np.array([PARTS * ROWS, PARTS * COLUMNS])[:, None, None] - 1) / 2
)


def seen(fine: F8, folder: Path) -> F4:
    """The light that a blurred camera gathers of a height on thirds of its pixels."""
    np.save(folder / "fine.npy", fine.astype(np.float32))
    nodes = {
        "height": {"op": "read_height", "with": {"file": str(folder / "fine.npy")}},
        "pixel": {"op": "pixel_size", "with": {"mm": SIDE_MM}},
        "lights": {"op": "light_ring", "with": {"slant_deg": 39, "distance_mm": 47}},
        "scene": {"op": "render", "in": {"height": "height", "pixel": "pixel", "lights": "lights"}},
    }
    with load({"format": 1, "nodes": nodes, "outputs": {"light": "scene.light"}}) as pipeline:
        (result,) = pipeline.items()
    spread = gaussian_filter(result.outputs["light"], (0, PARTS * BLUR_PX, PARTS * BLUR_PX))
    return np.asarray(spread.reshape(-1, ROWS, PARTS, COLUMNS, PARTS).mean((2, 4)))


def write(light: F4, folder: Path, seed: int, truth: F8 | None = None) -> Path:
    """A capture of that light, with the height on the thirds of pixels as its truth."""
    folder.mkdir(parents=True)
    for number, plane in enumerate(expose(light, seed=seed).image, start=1):
        cv2.imwrite(str(folder / f"led{number}.png"), np.round(255 * plane).astype(np.uint8))
    if truth is not None:
        middles = truth[1::PARTS, 1::PARTS].astype(np.float32)
        np.save(folder / "truth_height_mm.npy", middles)
    return folder


def certify(out: Path, *words: str) -> dict[str, float | None]:
    """The characteristics and the uncertainty of a statement, by the command line."""
    python("-m", "tactograph", "certify", *words, f"out={out}")
    record = json.loads((out / "statement.json").read_text())
    found = {each["name"]: each["value"] for each in record["characteristics"]}
    page = (out / "statement.html").read_text()
    assert all(name in page for name in found)
    assert [name for name, value in found.items() if value is None] == record["not_measured"]
    return {**found, **record["uncertainty"]}


def cap(x: float, depth: float) -> F8:
    """A ball pressed so deep, so far from the middle, in mm."""
    square = np.maximum(RADIUS_MM**2 - (X - x) ** 2 - Y * Y, 0)
    return np.maximum(np.sqrt(square) - RADIUS_MM + depth, 0)


@pytest.fixture(scope="module")
def sensor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a calibration of the rendered sensor, and captures of it."""
    folder = tmp_path_factory.mktemp("sensor")
    ball, film = seen(cap(0, 2.0), folder), seen(0 * X, folder)
    made = {"ball_radius_mm": RADIUS_MM, "pixel_size_mm": PIXEL_MM, "out": folder / "cal.npz"}
    rest = write(film, folder / "rest", 2)
    run("calibrate", capture=write(ball, folder / "ball", 1), flat=rest, **made)
    for seed in range(3, 6):
        write(ball, folder / "still" / f"{seed}", seed)
        write(film, folder / "flats" / f"{seed}", 10 + seed)
    for number, x in enumerate((-3.0, 1.0, 3.0)):
        light = seen(cap(x, 1.0 + 0.2 * number), folder)
        write(light, folder / "balls" / f"{number}", 20 + number)
    return folder


@pytest.mark.slow
def test_a_statement_holds_exactly_the_measured_characteristics(
    sensor: Path, tmp_path: Path
) -> None:
    known = ("calibration=cal.npz", "captures=balls", "still=still", "flats=flats")
    arguments = [f"{name}={sensor / value}" for name, value in (each.split("=") for each in known)]
    stated = certify(tmp_path, *arguments, f"ball_radius_mm={RADIUS_MM}", "ripples=0")
    blank = {name for name, value in stated.items() if value is None}
    assert blank == {
        "topographic_spatial_resolution_mm",
        "xy_amplification_coefficient",
        "xy_mapping_deviation_um",
    }
    assert stated["amplification_coefficient"] == pytest.approx(1, abs=0.01)
    assert 0 < stated["measurement_noise_um"] < 3
    assert abs(stated["drift_um"]) < 1
    assert stated["topography_fidelity_um"] < stated["expanded_uncertainty_um"] < 40
    assert 85 < stated["held_out_percent"] <= 100


@pytest.mark.slow
def test_the_transfer_function_is_that_of_the_rendered_truth(sensor: Path, tmp_path: Path) -> None:
    """By the calibration's own model, against an independent rendering of other ripples."""
    calibration = sensor / "cal.npz"
    (drawn,) = draw_ripples(calibration=calibration, count=1, seed=7)
    rows, columns = ((np.arange(PARTS * n) - 1) / PARTS for n in (ROWS, COLUMNS))
    places = np.meshgrid(rows, columns, indexing="ij")
    fine = map_coordinates(drawn.height.astype(np.float64), places, order=5)
    capture = write(seen(fine, tmp_path), tmp_path / "rippled", 11, fine)
    touch = measure_touches(captures=capture, calibration=calibration)
    real = transfer_function(touch.height, touch.truth, touch.pixel).metrics
    stated = certify(tmp_path / "out", f"calibration={calibration}")
    name = "topographic_spatial_resolution_mm"
    assert stated[name] == pytest.approx(real[name], rel=MOST_OFF)
    assert real[name] > 3 * PIXEL_MM
    assert stated["amplification_coefficient"] is None


@pytest.mark.slow
def test_wrong_input_is_refused_in_one_line(raytraced: Raytraced, calibration: Calibration) -> None:
    arguments = [
        f"calibration={calibration('near33')}",
        f"captures={raytraced / 'near33' / 'flat'}",
    ]
    for words, message in (
        (arguments, "no touch shows a whole known shape"),
        (
            [*arguments[:1], f"grid={raytraced / 'near33'}"],
            "a grid needs both: grid=IMAGE pitch_mm=",
        ),
        (["captures=x"], "calibration"),
    ):
        done = python("-m", "tactograph", "certify", *words, "ripples=0", code=2)
        assert message in done.stderr.splitlines()[-1]
        assert "Traceback" not in done.stderr


def test_a_round_film_is_not_certified(calibration: Calibration, tmp_path: Path) -> None:
    """Balls above a film that is no plane are no balls."""
    with np.load(calibration("near33")) as known:
        arrays = dict(known)
    arrays["rest"] = np.full(arrays["flat"].shape[1:], 0.1, np.float32)
    np.savez(tmp_path / "round.npz", **arrays)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"round.npz: its film is no plane at rest"):
        certified_sensor(tmp_path / "round.npz")
