"""Slopes by a light model: what the model lights up is found again."""

from pathlib import Path

import numpy as np
import pytest

from tactograph.graph.errors import collect_warnings
from tactograph.nodes.scan.judge_light_model import judge_light_model
from tactograph.nodes.scan.judge_untouched import judge_untouched
from tactograph.nodes.scan.light_model_slope import light_model_slope
from tactograph.nodes.scan.read_light_model import read_light_model
from tests.nodes.scan.scans import PIXEL, WIDTH, cap, seen, write_model, write_scan


@pytest.mark.parametrize("flat", [False, True], ids=["no flat field", "flat field"])
@pytest.mark.parametrize("brightness", [1.0, 1.1])
def test_slope_and_brightness_of_a_cap_are_found(
    tmp_path: Path, flat: bool, brightness: float
) -> None:
    write_model(tmp_path / "model.yaml", flat)
    model = read_light_model(file=tmp_path / "model.yaml").model
    z = cap()
    found = light_model_slope(np.float32(brightness) * seen(z, model), model)
    q, p = np.gradient(z / PIXEL)
    smooth = np.hypot(p, q) < 1
    assert np.abs(found.slope[0] - p)[smooth].max() < 2e-3
    assert np.abs(found.slope[1] - q)[smooth].max() < 2e-3
    assert found.brightness[smooth] == pytest.approx(brightness, abs=1e-3)
    assert found.residual[smooth].max() < 1e-4


def test_a_flat_film_has_no_slope_anywhere_in_the_frame(tmp_path: Path) -> None:
    write_model(tmp_path / "model.yaml")
    model = read_light_model(file=tmp_path / "model.yaml").model
    assert np.abs(light_model_slope(seen(0 * cap(), model), model).slope).max() < 1e-4


def test_the_leds_that_do_not_light_a_pixel_are_labelled(tmp_path: Path) -> None:
    write_model(tmp_path / "model.yaml")
    model = read_light_model(file=tmp_path / "model.yaml").model
    light = seen(0 * cap(), model)
    light[2, 10:30, 20:40] = 0.1
    shadow = light_model_slope(light, model).shadow
    assert (shadow[10:30, 20:40] == 4).all()
    assert (shadow == 4).sum() == 400
    assert set(np.unique(shadow)) == {0, 4}


def test_light_of_another_kind_leaves_a_residual(tmp_path: Path) -> None:
    write_model(tmp_path / "model.yaml")
    model = read_light_model(file=tmp_path / "model.yaml").model
    light = seen(cap(), model)
    light[2] *= 0.5
    assert np.median(light_model_slope(light, model).residual) > 0.02


def test_a_model_of_another_sensor_is_told(tmp_path: Path) -> None:
    write_model(tmp_path / "model.yaml")
    model = read_light_model(file=tmp_path / "model.yaml").model
    light = seen(cap() + np.float32(0.4 * PIXEL) * np.arange(WIDTH, dtype=np.float32), model)
    kinds = {
        "": light,
        "in the order of its LEDs": light[[1, 0, 2, 3, 4, 5]],
        "1.5 times as bright": 1.5 * light,
    }
    for words, images in kinds.items():
        with collect_warnings([]) as told:
            found = light_model_slope(np.float32(images), model)
            judge_light_model(found.brightness, found.residual)
        assert words in told[0] if words else not told


@pytest.mark.parametrize(("tilt", "told_of"), [(0.0, False), (0.04, True)])
def test_untouched_film_that_seems_tilted_is_told(
    tmp_path: Path, tilt: float, told_of: bool
) -> None:
    write_model(tmp_path / "model.yaml", flat=True)
    whole, cells = (
        read_light_model(file=tmp_path / "model.yaml", cell=side).model for side in (1, 4)
    )
    z = 0 * cap() + np.float32(tilt * PIXEL) * np.arange(WIDTH, dtype=np.float32)
    write_scan(tmp_path / "flat", seen(z, whole))
    told: list[str] = []
    with collect_warnings(told):
        figures = judge_untouched(cells, folder=tmp_path / "flat", cell=4)
    assert figures["untouched_slope"] == pytest.approx(tilt, abs=2e-3)
    assert bool(told) == told_of
    assert judge_untouched(cells) == {}


def test_a_crop_keeps_its_positions(tmp_path: Path) -> None:
    write_model(tmp_path / "model.yaml", flat=True)
    whole = read_light_model(file=tmp_path / "model.yaml").model
    part = read_light_model(file=tmp_path / "model.yaml", crop=(20, 8, 84, 56)).model
    light = seen(cap(), whole)
    every = light_model_slope(light, whole).slope
    cropped = light_model_slope(np.ascontiguousarray(light[:, 8:56, 20:84]), part).slope
    np.testing.assert_allclose(cropped, every[:, 8:56, 20:84], atol=1e-5)
