"""Slopes by a light model: what the model lights up is found again."""

from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from rings.metrology.tests.scan.scans import PIXEL, WIDTH, cap, seen, write_model, write_scan
from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.nodes.capture.read_capture import read_capture
from tactograph.nodes.light.coarsen import coarsen
from tactograph.rings.metrology.nodes.scan.judge_light_model import judge_light_model
from tactograph.rings.metrology.nodes.scan.judge_untouched import judge_untouched
from tactograph.rings.metrology.nodes.scan.light_model import LightModel
from tactograph.rings.metrology.nodes.scan.light_model_slope import light_model_slope
from tactograph.rings.metrology.nodes.scan.read_light_model import read_light_model
from tests.fixtures import real_data

RAMP = PIXEL * np.arange(WIDTH, dtype=np.float32)


@pytest.mark.parametrize("flat", [False, True], ids=["no flat field", "flat field"])
@pytest.mark.parametrize("brightness", [1.0, 1.1])
def test_slope_and_brightness_of_a_cap_are_found(
    model_file: Path, flat: bool, brightness: float
) -> None:
    model, z = write_model(model_file, flat), cap()
    found = light_model_slope(np.float32(brightness) * seen(z, model), model)
    p, q = np.gradient(z / PIXEL)[::-1]
    smooth = np.hypot(p, q) < 1
    assert np.abs(found.slope - [p, q])[:, smooth].max() < 2e-3
    assert found.brightness[smooth] == pytest.approx(brightness, abs=1e-3)
    assert found.residual[smooth].max() < 1e-4


def test_the_leds_that_do_not_light_a_pixel_are_labelled(model: LightModel) -> None:
    light = seen(0 * cap(), model)
    light[2, 10:30, 20:40] = 0.1
    expected = np.zeros(light.shape[1:], np.uint8)
    expected[10:30, 20:40] = 4
    np.testing.assert_array_equal(light_model_slope(light, model).shadow, expected)


def test_light_of_another_kind_is_reported_or_refused(model: LightModel) -> None:
    light = seen(cap() + 0.4 * RAMP, model)
    faint = np.float32([1, 1, 0.9, 1, 1, 1])[:, None, None] * light
    kinds = [
        ("", False, light),
        ("in the order of its LEDs", True, light[[1, 0, 2, 3, 4, 5]]),
        ("is it this sensor's", False, faint),
        ("is it this sensor's", True, 1.5 * faint),
        ("is it this sensor's", True, (faint**3)[[1, 2, 3, 4, 5, 0]]),
        ("1.5 times as bright", False, 1.5 * light),
    ]
    for words, refused, images in kinds:
        with collect_warnings([]) as messages:
            found = light_model_slope(np.float32(images), model)
            judge_light_model(found, only_warn=True)
        assert words in messages[0] if words else not messages
        with pytest.raises(InputError, match=words) if refused else nullcontext():
            judge_light_model(found, np.float32(images), model)


@pytest.mark.slow
@pytest.mark.parametrize("order", [[1, 2, 3, 4, 5, 0], [5, 4, 3, 2, 1, 0], [2, 1, 0, 5, 4, 3]])
def test_an_order_turned_or_mirrored_is_refused_and_the_right_one_named(order: list[int]) -> None:
    """Of real balls, whose own order is accepted."""
    (taken,) = read_capture(folder=real_data("gelsight_six_led") / "balls_2")
    file = real_data("gelsight_scans") / "oem/demo-calibration.yaml"
    light, model = coarsen(taken.image, factor=16), read_light_model(file=file, cell=16).model
    for images, right in ((light[order], False), (light, True)):
        found = light_model_slope(images, model)
        sorted_by = ", ".join(str(order.index(led) + 1) for led in range(6))
        with nullcontext() if right else pytest.raises(InputError, match=f"order {sorted_by} of"):
            judge_light_model(found, images, model)


@pytest.mark.parametrize(("tilt", "told_of"), [(0.0, False), (0.04, True)])
def test_untouched_film_that_appears_tilted_gives_a_warning(
    tmp_path: Path, model: LightModel, tilt: float, told_of: bool
) -> None:
    write_scan(tmp_path / "flat", seen(0 * cap() + np.float32(tilt) * RAMP, model))
    with collect_warnings([]) as messages:
        figures = judge_untouched(model, folder=tmp_path / "flat", cell=4)
    assert figures["untouched_slope"] == pytest.approx(tilt, abs=2e-3)
    assert bool(messages) == told_of
    assert judge_untouched(model) == {}
    write_scan(tmp_path / "part", seen(cap(), model)[:, 2:])
    with pytest.raises(InputError, match=r"of 96 x 64 pixels, but .*part has 6"):
        judge_untouched(model, folder=tmp_path / "part", cell=4)


def test_a_crop_keeps_its_positions(model_file: Path, model: LightModel) -> None:
    part = read_light_model(file=model_file, crop=(20, 8, 84, 56)).model
    light = seen(cap(), model)
    every = light_model_slope(light, model).slope
    cropped = light_model_slope(np.ascontiguousarray(light[:, 8:56, 20:84]), part).slope
    np.testing.assert_allclose(cropped, every[:, 8:56, 20:84], atol=1e-5)
