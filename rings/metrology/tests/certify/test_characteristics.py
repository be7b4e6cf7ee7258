"""Characteristics of sensors whose errors are put in by hand."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from rings.camera.tests.grids import dots, on_film, pixels
from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4, F8
from tactograph.rings.metrology.nodes.certify.compare_shapes import Compared, compare_shapes
from tactograph.rings.metrology.nodes.certify.flatness_deviation import flatness_deviation
from tactograph.rings.metrology.nodes.certify.measurement_noise import measurement_noise
from tactograph.rings.metrology.nodes.certify.response_curve import response_curve
from tactograph.rings.metrology.nodes.certify.transfer_function import transfer_function
from tactograph.rings.metrology.nodes.certify.xy_mapping import xy_mapping
from tests.fixtures import Calibration

PIXEL, ROWS, COLUMNS = 0.02, 120, 160
Y, X = PIXEL * np.indices((ROWS, COLUMNS))
RADIUS_MM = 0.5


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def test_noise_is_the_spread_of_repeats_and_drift_their_trend(
    rng: np.random.Generator,
) -> None:
    film = 0.3 * np.sin(X) + 1e-3 * rng.normal(0, 0.8, (6, ROWS, COLUMNS))
    film += 1e-3 * np.linspace(0, 10, 6)[:, None, None]
    found = measurement_noise(film.astype(np.float32))
    assert found["measurement_noise_um"] == pytest.approx(0.8, rel=0.02)
    assert found["drift_um"] == pytest.approx(10, abs=0.1)
    assert found["topography_repeatability_um"] > 3
    with pytest.raises(InputError, match="one still capture"):
        measurement_noise(film[:1].astype(np.float32))


def test_the_flatness_of_a_mean_leaves_out_its_noise(rng: np.random.Generator) -> None:
    bent = 2e-3 * np.cos(2 * np.pi * X / (COLUMNS * PIXEL))
    film = (bent + 1e-3 * rng.normal(0, 1, (4, ROWS, COLUMNS))).astype(np.float32)
    found = flatness_deviation(film)
    assert found["flatness_rms_um"] == pytest.approx(2 / np.sqrt(2), rel=0.02)
    assert 4 < found["flatness_deviation_um"] < 9


def balls(scale: float, tilt: float = 0.0) -> F4:
    """Two balls that sit half a radius deep, the second cut off by the border."""
    height = np.zeros((ROWS, COLUMNS))
    for x, y in ((1.103, 1.212), (3.1, 1.2)):
        square = RADIUS_MM**2 - (X - x) ** 2 - (Y - y) ** 2
        height = np.maximum(height, np.sqrt(np.maximum(square, 0)) - RADIUS_MM / 2)
    return (scale * height + tilt * X).astype(np.float32)


@pytest.mark.parametrize("scale", [1.0, 1.05])
def test_a_whole_ball_is_found_and_tells_the_amplification(scale: float) -> None:
    compared = compare_shapes(balls(scale)[None], pixel=PIXEL, ball_radius_mm=RADIUS_MM)
    found = response_curve(compared).metrics
    assert found["known_shapes"] == 1
    assert found["amplification_coefficient"] == pytest.approx(scale, abs=1e-3)


def test_how_deep_a_ball_sits_does_not_matter() -> None:
    deeper = compare_shapes((balls(1.0) + 0.1)[None], pixel=PIXEL, ball_radius_mm=RADIUS_MM)
    np.testing.assert_allclose(deeper.measured, deeper.true, atol=1e-4)


def test_a_shape_that_nothing_tells_is_refused() -> None:
    with pytest.raises(InputError, match=r"no truth_height_mm\.npy.*`ball_radius_mm`"):
        compare_shapes(balls(1.0)[None], pixel=PIXEL)
    with pytest.raises(InputError, match="no touch shows a whole known shape"):
        compare_shapes(np.zeros((1, ROWS, COLUMNS), np.float32), pixel=PIXEL, ball_radius_mm=0.5)
    assert compare_shapes() == Compared()


@pytest.mark.parametrize(("zero", "off"), [("rest", 0.62), ("free", 0.32), ("plane", 0.0)])
def test_free_terms_of_a_height_are_fitted_to_its_truth(zero: str, off: float) -> None:
    """A height that is 0.3 mm too high, and tilted by 0.32 mm from its middle to its sides."""
    truth = (0.1 + 0.05 * np.sin(3 * X)).astype(np.float32)
    wrong = truth + 0.3 + 0.2 * (X - X.mean())
    compared = compare_shapes(
        wrong[None].astype(np.float32), truth=truth[None], pixel=PIXEL, zero=zero
    )
    most = np.abs(compared.measured - compared.true).max()
    assert most == pytest.approx(off, abs=0.01)


def points(true: F8, found: F8, shapes: int) -> Compared:
    shape = np.arange(len(true)) % shapes
    unstated = np.full(len(true), np.nan)
    return Compared(true, found, unstated, shape.astype(np.int32), (shape // 5).astype(np.int32))


def test_a_response_is_split_into_its_parts(rng: np.random.Generator) -> None:
    """1.02 on the mean, 3 % from touch to touch, a parabola of 2 um, 1 um of all else."""
    count, shapes = 200_000, 50
    true = rng.uniform(0.0, 0.4, count)
    gain = 1.02 + np.repeat(0.03 * np.linspace(-1.5, 1.5, 10), 5)
    bow = 2e-3 * (6 * (true / 0.4) * (1 - true / 0.4) - 1)
    found = gain[np.arange(count) % shapes] * true + bow + 1e-3 * rng.normal(size=count)
    response = response_curve(points(true, found, shapes))
    figures = response.metrics
    assert figures["amplification_coefficient"] == pytest.approx(1.02, abs=0.003)
    assert figures["linearity_deviation_um"] == pytest.approx(1.8, abs=0.4)
    assert figures["reproducibility_percent"] == pytest.approx(100 * 0.03 * 0.957, rel=0.1)
    assert figures["height_range_um"] == pytest.approx(400, rel=0.01)
    assert response.curve is not None
    np.testing.assert_allclose(response.curve[2].min(), 0.001, rtol=5)


@pytest.mark.parametrize("wave_px", [5.0, 9.0])
def test_the_half_of_a_gaussian_filter_is_found_under_noise(
    wave_px: float, rng: np.random.Generator
) -> None:
    """A Gaussian of ISO 16610-61 passes half of a wave as long as its nesting index."""
    truth = rng.normal(0, 1e-2, (2, ROWS, COLUMNS))
    cycles = np.hypot(np.fft.rfftfreq(COLUMNS), np.fft.fftfreq(ROWS)[:, None])
    passed = np.exp(-np.log(2) * np.square(cycles * wave_px))
    found = np.fft.irfft2(np.fft.rfft2(truth) * passed, s=(ROWS, COLUMNS))
    found += rng.normal(0, 1e-3, found.shape)
    got = transfer_function(found.astype(np.float32), truth.astype(np.float32), PIXEL)
    resolved = got.metrics["topographic_spatial_resolution_mm"]
    assert resolved == pytest.approx(wave_px * PIXEL, rel=0.03)


def test_pixels_limit_resolution_where_nothing_else_does() -> None:
    truth = np.random.default_rng(1).normal(0, 1e-2, (1, ROWS, COLUMNS)).astype(np.float32)
    with collect_warnings(messages := []):
        got = transfer_function(truth, truth, PIXEL).metrics
    assert "pixels limit resolution" in messages[0]
    assert got["topographic_spatial_resolution_mm"] == pytest.approx(2 * PIXEL)


def test_nothing_measured_says_nothing() -> None:
    assert measurement_noise() == {}
    assert flatness_deviation() == {}
    assert response_curve(Compared()).metrics == {}
    assert transfer_function().metrics == {}


@pytest.mark.parametrize("scale", [1.0, 1.01])
def test_a_grid_tells_by_how_much_lengths_are_too_long(
    scale: float, calibration: Calibration, tmp_path: Path
) -> None:
    file, pitch_mm = calibration("near33"), 1.5
    with np.load(file, allow_pickle=False) as read:
        shape, pixel = read["flat"].shape[1:], float(read["pixel_size"])
    straight = np.zeros(8, np.float32)
    image = pixels(dots(*on_film(shape, straight, scale * pitch_mm / pixel, 0.1, (0.2, 0.3))))
    cv2.imwrite(str(tmp_path / "grid.png"), np.rint(255 * image).astype(np.uint8))
    found = xy_mapping(calibration=Path(file), grid=tmp_path / "grid.png", pitch_mm=pitch_mm)
    assert found["xy_amplification_coefficient"] == pytest.approx(scale, abs=2e-4)
    assert found["xy_mapping_rms_um"] < found["xy_mapping_deviation_um"] < 5
    assert xy_mapping(calibration=Path(file)) == {}
