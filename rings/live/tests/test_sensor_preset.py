"""A kind of sensor is a small file that one can copy and change."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes.calibrate.camera.pixel_size import pixel_size
from tactograph.rings.live.nodes.camera.camera_params import CameraParams
from tactograph.rings.live.nodes.camera.open_camera import View
from tactograph.rings.live.nodes.camera.sensor_kind import camera_settings, preset_of
from tactograph.rings.live.nodes.camera.sensor_preset import SensorPreset, shipped_presets
from tactograph.rings.live.nodes.touches.sensor import open_colour_sensor, open_rig


@pytest.mark.parametrize("name", sorted(shipped_presets()))
def test_a_shipped_preset_can_be_copied(name: str, tmp_path: Path) -> None:
    copy = tmp_path / "mine.yaml"
    copy.write_text(shipped_presets()[name].read_text().replace("turn_deg: 0 ", "turn_deg: 180"))
    mine, shipped = SensorPreset.read(str(copy)), SensorPreset.read(name)
    assert mine.size == shipped.size
    assert pixel_size(stated=shipped.pixel_size_mm) == shipped.pixel_size_mm


def test_a_stated_pixel_size_goes_before_the_sensors() -> None:
    assert pixel_size(mm=0.05, stated=SensorPreset.read("gelsight_mini").pixel_size_mm) == 0.05


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("format: 1\nsize: [320, 240]\npixel_size_mm: -1\n", r"mine\.yaml:3:1: pixel_size_mm: "),
        (
            "format: 1\nsize: [320, 240]\npixel_size_mm: 1\nled: 3\n",
            r"mine\.yaml:4:1: led: unknown key; did you mean 'leds'\?",
        ),
        (
            "format: 1\nsize: [320, 240]\npixel_size_mm: 0.1\ncrop: [0.5, 0, 0.2, 1]\n",
            r"mine\.yaml:4:1: crop: nothing lies between",
        ),
    ],
)
def test_a_mistake_is_reported_with_its_place(text: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(text)
    with pytest.raises(InputError, match=says):
        SensorPreset.read(str(tmp_path / "mine.yaml"))


@pytest.mark.parametrize("number", [".inf", ".nan", "1e300", "9" * 330])
@pytest.mark.parametrize(
    "place", ["pixel_size_mm", "warm_up_s", "camera.rate", "camera.exposure", "camera.gain"]
)
def test_a_number_that_no_camera_has_is_refused(place: str, number: str, tmp_path: Path) -> None:
    part, _, name = place.rpartition(".")
    entry = f"{name}: {number}" if not part else f"{part}: {{{name}: {number}}}"
    usual = "" if name == "pixel_size_mm" else "pixel_size_mm: 0.1\n"
    (tmp_path / "mine.yaml").write_text(f"format: 1\nsize: [320, 240]\n{usual}{entry}\n")
    with pytest.raises(InputError, match=rf"mine\.yaml:\d:\d+: {place}: input should be"):
        SensorPreset.read(str(tmp_path / "mine.yaml"))


FLASHING = "format: 1\nleds: 4\nsize: [160, 120]\npixel_size_mm: 0.1\ncamera: {gain: 3}\n"


def test_a_preset_states_the_cycle_of_flashing_leds(tmp_path: Path) -> None:
    file = tmp_path / "bench.yaml"
    file.write_text(FLASHING)
    preset = preset_of(str(file), flashing=True)
    assert preset is not None
    driver = CameraParams("simulated", sensor=str(file))
    rig = open_rig(driver, "none", (None, None), leds=4)
    with closing(rig):
        assert rig.camera.shots(2.0)[0].data.shape == (120, 160)
    wanted = camera_settings(driver, (160, 120), preset, colour=False)
    assert (wanted.gain, wanted.view) == (3, View(0, (0, 0, 1, 1), (160, 120)))


@pytest.mark.parametrize("flashing", [True, False])
def test_a_preset_of_the_other_kind_is_refused(flashing: bool, tmp_path: Path) -> None:
    file = tmp_path / "bench.yaml"
    file.write_text(FLASHING if not flashing else FLASHING.replace("leds: 4\n", ""))
    with pytest.raises(InputError, match="at once" if flashing else "its LEDs flash"):
        preset_of(str(file), flashing=flashing)


def test_an_unknown_sensor_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"`sensor`=mimi: is neither .* digit, gelsight_mini"):
        SensorPreset.read("mimi")


def test_a_picture_is_turned_cropped_and_shrunk_or_unchanged() -> None:
    picture = np.zeros((40, 60, 3), np.uint8)
    picture[:, 50:] = (10, 20, 30)  # what is right becomes what is above
    seen = View(90, (0.0, 0.0, 1.0, 0.5), (20, 15)).of(picture)
    assert seen.shape == (15, 20, 3)
    np.testing.assert_array_equal(seen[0, 0], (10, 20, 30))
    np.testing.assert_array_equal(seen[-1, 0], (0, 0, 0))
    right = np.arange(24, dtype=np.uint16).reshape(4, 6)
    np.testing.assert_array_equal(View(0, (0, 0, 1, 1), (6, 4)).of(right), right)


def test_a_calibration_of_another_size_is_refused() -> None:
    with pytest.raises(InputError, match=r"gives 320 x 240 pixels, but the calibration is for 64"):
        open_colour_sensor(CameraParams("/dev/video99", sensor="gelsight_mini"), (64, 48))


def test_a_simulated_sensor_has_the_presets_size() -> None:
    sensor = open_colour_sensor(CameraParams("simulated", sensor="digit"), (None, None))
    try:
        (shot, *_) = sensor.camera.shots(2.0)
        assert shot.data.shape == (320, 240, 3)
    finally:
        sensor.close()
