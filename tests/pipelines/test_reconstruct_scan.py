"""A scan, by its sensor's light model alone."""

from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import load
from tactograph.nodes import BAND_DEVIATIONS
from tactograph.nodes.metrology.measure_step import measure_step
from tactograph.nodes.scan.read_light_model import read_light_model
from tests.conftest import real_data
from tests.nodes.scan.scans import HEIGHT, PIXEL, WIDTH, cap, seen, write_model, write_scan


def test_a_cap_has_its_height(tmp_path: Path) -> None:
    write_model(tmp_path / "model.yaml", flat=True)
    model = read_light_model(file=tmp_path / "model.yaml").model
    z = cap(radius=0.9, depth=0.06)
    write_scan(tmp_path / "scan", seen(z, model), calib="model.yaml")
    (found,) = load("reconstruct_scan", capture=tmp_path / "scan", model=tmp_path / "scan").items()
    assert found["height"].shape == (HEIGHT, WIDTH)
    assert found["pixel"] == PIXEL
    assert found["height"].max() == pytest.approx(z.max(), rel=0.02)
    assert np.sqrt(np.mean((found["height"] - z) ** 2)) < 2e-3
    given = {"capture": tmp_path / "scan", "model": tmp_path / "scan", "scale": (1.1, 0.05)}
    (scaled,) = load("reconstruct_scan", **given).items()
    np.testing.assert_allclose(scaled["height"], 1.1 * found["height"], rtol=1e-5)
    of_scale = np.hypot(1.1 * found["error"], 0.05 * found["height"])
    np.testing.assert_allclose(scaled["error"], of_scale, rtol=1e-4)


def test_a_model_for_other_pixels_than_the_scans_is_told(tmp_path: Path) -> None:
    file = tmp_path / "model.yaml"
    write_model(file)
    write_scan(tmp_path / "scan", seen(cap(), read_light_model(file=file).model))
    file.write_text(file.read_text().replace(f"mmperpixel: {PIXEL}", "mmperpixel: 0.05"))
    (found,) = load("reconstruct_scan", capture=tmp_path / "scan", model=file).items()
    assert found["pixel"] == PIXEL
    told = f"the scan says {PIXEL} mm per px, its light model 0.05: the scan's is taken"
    assert any(told in warning for warning in found.warnings)
    (settled,) = load(
        "reconstruct_scan", capture=tmp_path / "scan", model=file, pixel_size_mm=0.03
    ).items()
    assert settled["pixel"] == pytest.approx(0.03)
    assert not any("the scan says" in warning for warning in settled.warnings)


@pytest.mark.slow
@pytest.mark.parametrize(
    "device", ["series1_1587_M6G0", "series2_2EF6_4JNW", "modulus1600_570C_TRLJ"]
)
def test_a_groove_seen_through_a_real_sensors_model_has_its_depth(device: str) -> None:
    """500 um with walls of 30 degrees, 1 % of noise."""
    file = real_data("gelsight_scans") / "devices" / f"{device}.yaml"
    crop = (32, 900, 2432, 1060)
    sensor = read_light_model(file=file, crop=crop)
    x = sensor.pixel_size * (np.arange(crop[2] - crop[0]) - 1200)
    run = 0.5 / np.tan(np.radians(30))
    profile = -0.5 * np.clip((1 + run / 2 - np.abs(x) + 0.5) / run, 0, 1)
    z = np.tile(profile.astype(np.float32), (crop[3] - crop[1], 1))
    rng = np.random.default_rng(0)
    light = seen(z, sensor.model, sensor.pixel_size)
    light = (light * (1 + 0.01 * rng.normal(size=light.shape))).astype(np.float32)
    found = load("reconstruct_scan", model=file, crop=list(crop))(frames=np.clip(light, 0, 1))
    figures = measure_step(found["height"], sensor.pixel_size, found["error"])
    assert figures["step_depth_um"] == pytest.approx(500, abs=1)
    assert 0.03 < figures["step_uncertainty_um"] < 0.5
    rows = [
        measure_step(np.repeat(row[None], 5, 0), sensor.pixel_size)["step_depth_um"]
        for row in found["height"][::16]
    ]
    band = BAND_DEVIATIONS * figures["step_uncertainty_um"]
    assert np.mean(np.abs(np.array(rows) - 500) < band) > 0.85
