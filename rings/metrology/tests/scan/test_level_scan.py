"""Levelled heights of scans, and the error that is stated: it grows with what the model misses."""

import warnings
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.real_film import measure
from benchmarks.scans import ramp, rendered
from rings.metrology.tests.scan.scans import HEIGHT, PIXEL, WIDTH, cap, seen
from tactograph.graph import InputError, load
from tactograph.nodes import BAND_DEVIATIONS, F4, F8
from tactograph.rings.metrology.nodes.scan._scan_error import _parts
from tactograph.rings.metrology.nodes.scan.read_light_model import read_light_model
from tests.fixtures import real_data


def states(file: Path, noise: float, wrong: float, seed: int) -> tuple[F4, F4]:
    """The error of the height of a cap, and what is stated; LEDs wrong each in its own way."""
    z, rng = cap(radius=0.9, depth=0.06), np.random.default_rng(seed)
    light = seen(z, read_light_model(file=file).model)
    light *= 1 + rng.normal(0, noise, light.shape)
    light *= 1 + rng.normal(0, wrong, (len(light), 1, 1))
    scan = load("reconstruct_scan", model=file, backend="numpy", level="rest", cell_px=4)
    found = scan(frames=light.astype(np.float32))
    off = found["height"] - z
    return off - off[0].mean(), found["error"]


def test_noise_stays_in_its_band(model_file: Path) -> None:
    found = [states(model_file, 0.01, 0.0, seed) for seed in range(8)]
    inside = [(np.abs(off) < BAND_DEVIATIONS * error).mean() for off, error in found]
    assert 0.8 < np.mean(inside) < 0.98


def test_light_that_no_slope_explains_widens_the_error(model_file: Path) -> None:
    right, wrong = (states(model_file, 0.01, by, 3)[1] for by in (0.0, 0.03))
    assert np.median(wrong) > 3 * np.median(right)


def test_twice_the_noise_is_twice_the_error(model_file: Path) -> None:
    once, twice = (np.median(states(model_file, noise, 0.0, 5)[1]) for noise in (0.01, 0.02))
    assert twice / once == pytest.approx(2, rel=0.3)


def test_a_fold_hides_no_noise() -> None:
    """A cell's mean light over a fold is that of no slope, however little noise there is."""
    single = np.full((12, 20), 0.003, np.float32)
    residual = single / 16
    level, _ = _parts(residual, single, 6, 16)
    residual[:, 8:10] = 0.007
    folded, _ = _parts(residual, single, 6, 16)
    np.testing.assert_allclose(folded, level, rtol=0.01)


def levelled(file: Path, z: F4, level: str = "flat") -> tuple[F4, list[str]]:
    """The error of a reconstructed height, and the warnings."""
    light = seen(z, read_light_model(file=file).model)
    with warnings.catch_warnings(action="ignore"):
        found = load("reconstruct_scan", model=file, level=level, cell_px=4)(frames=light)
    off = found["height"] - z
    return off - np.median(off), found.warnings


def bowed(slope: float) -> F4:
    """A dome whose slope changes by that from the left of the frame to the right."""
    x = PIXEL * (np.arange(WIDTH, dtype=np.float32) - WIDTH / 2)
    return np.tile(-slope / (2 * PIXEL * WIDTH) * x * x, (HEIGHT, 1)).astype(np.float32)


def test_a_bow_of_flat_film_is_removed_with_a_warning(model_file: Path) -> None:
    press, bow = cap(radius=0.9, depth=0.06), bowed(0.08)
    off, messages = levelled(model_file, press + bow)
    assert np.ptp(off + bow - np.median(off + bow)) < 0.3 * np.ptp(bow)
    assert any("level=plane leaves it" in warning for warning in messages)
    kept, messages = levelled(model_file, press + bow, "plane")
    assert np.ptp(kept) < 0.3 * np.ptp(bow)
    assert not messages


def test_a_strongly_bent_surface_is_not_flat_film(model_file: Path) -> None:
    off, messages = levelled(model_file, bowed(0.4))
    assert np.ptp(off) < 0.05 * np.ptp(bowed(0.4))
    assert any("too much for flat film" in warning for warning in messages)


def mask_of(file: Path, marked: slice | tuple[slice, ...]) -> str:
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[marked] = 255
    cv2.imwrite(str(file.with_name("mask.png")), mask)
    return str(file.with_name("mask.png"))


@pytest.mark.parametrize(("columns", "taken"), [(WIDTH, True), (WIDTH // 4, False)])
def test_enough_marked_film_shows_a_bow(model_file: Path, columns: int, taken: bool) -> None:
    bow = bowed(0.08)
    off, _ = levelled(model_file, bow, mask_of(model_file, np.s_[:, :columns]))
    assert bool(np.ptp(off + bow) < 0.1 * np.ptp(bow)) == taken


@pytest.mark.parametrize("marked", [np.s_[:0], np.s_[8:9], np.s_[:, 4:5]])
def test_a_mask_that_marks_no_plane_is_refused(model_file: Path, marked: slice) -> None:
    with pytest.raises(InputError, match=r"mask\.png: marks fewer than three pixels .* or a line"):
        levelled(model_file, cap(), mask_of(model_file, marked))


def test_a_frame_of_one_cell_has_a_height(model_file: Path) -> None:
    crop = {"model": model_file, "crop": (0, 0, 10, 8)}
    model = read_light_model(file=crop["model"], crop=crop["crop"]).model
    found = load("reconstruct_scan", **crop)(frames=seen(0 * cap()[:8, :10], model))
    assert np.isfinite(found["height"]).all()


@pytest.mark.slow
def test_film_between_balls_is_flat_by_the_sensors_own_model() -> None:
    """A grid of steel balls on flat film; by a plane alone, film between them bows by 25 um."""
    grids, file = real_data("gelsight_six_led"), "oem/demo-calibration.yaml"
    (found,) = load(
        "reconstruct_scan", capture=grids / "balls_2", model=real_data("gelsight_scans") / file
    ).items()
    grid = measure(found, grids / "balls_2.csv", 1)
    assert grid.normal_deg < 1.45
    assert grid.cap_um < 1.6
    assert grid.film_um < 10


@pytest.mark.slow
@pytest.mark.parametrize(
    "surface",
    [
        pytest.param(lambda x, _: -ramp(0.3, 45, 0.4 - abs(x)), id="groove"),
        pytest.param(lambda x, _: ramp(0.3, 30, -0.4 - x), id="step"),
    ],
)
def test_sharp_edges_stay_in_the_band(surface: Callable[[F8, F8], F8]) -> None:
    """Pixels that see two slopes, and a step over a third of the frame."""
    file = real_data("gelsight_scans") / "devices/series2_2EF6_4JNW.yaml"
    off, _, _, inside = rendered(file, surface, "flat")
    assert off < 1
    assert 0.75 < inside < 0.97
