"""A person, or one made of software, is led through a calibration."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import EndOfStream, InputError
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes import Metrics
from tactograph.nodes.calibrate.file.read_calibration import read_calibration
from tactograph.rings.live.nodes.guide.end_when_good import end_when_good
from tactograph.rings.live.nodes.guide.guide_presses import guide_presses
from tests.fixtures import python

pytestmark = pytest.mark.realtime

SCENE = (
    "simulated?by_hand=true&width_px=160&height_px=120&pixel_size_mm=0.15&slant_deg=33"
    "&distance_mm=60&radius_mm=3&depth_mm=1.1&path_mm=8&press_s=2"
)
GIVEN = {"port": "simulated", "ball_radius_mm": 3.0, "pixel_size_mm": 0.15}
GOOD: Metrics = {
    "heldout_normal_deg": 0.5, "heldout_height_um": 3.0, "film_covered_percent": 60.0,
    "slopes_covered_percent": 80.0, "presses": 3.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def guided(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The calibration of a session that ended by itself."""
    file = tmp_path_factory.mktemp("guided") / "cal.npz"
    command = ["-m", "tactograph.graph.command", "run", "calibrate_live"]
    command += [f"{name}={value}" for name, value in GIVEN.items()]
    command += [f"camera={SCENE}", f"out={file}", "--set", "end.film_percent=10"]
    command += ["--set", "end.min_presses=2"]
    done = python(*command)
    file.with_suffix(".out").write_text(done.stdout)
    file.with_suffix(".err").write_text(done.stderr)
    return file


def test_a_session_ends_with_a_good_calibration(guided: Path) -> None:
    x, y, z = read_calibration(file=guided).film.lights.astype(float).T
    np.testing.assert_allclose(np.degrees(np.arctan2(np.hypot(x, y), z)), 33, atol=0.5)
    np.testing.assert_allclose(np.sqrt(x * x + y * y + z * z), 60, atol=1.5)
    lines = guided.with_suffix(".out").read_text().splitlines()
    assert any(line.startswith("good: ") for line in lines)
    assert guided.with_suffix(".png").stat().st_size > 10_000


def test_the_guide_says_what_to_do(guided: Path) -> None:
    lines = guided.with_suffix(".err").read_text().splitlines()
    asked = [line for line in lines if not line.startswith("warning")]
    assert asked[:3] == [
        "Take everything off the film, and leave it alone.",
        "Press the ball into the film, and hold it still.",
        "Press 1 is taken: let go.",
    ]
    assert "next: press" in guided.with_suffix(".out").read_text()


def test_the_kept_captures_give_the_same_calibration(guided: Path) -> None:
    folder, again = guided.with_name("cal_presses"), guided.with_name("again.npz")
    arguments = {
        "capture": folder / "pressed", "flat": folder / "untouched", "dark": folder / "dark.png",
        "pixel_size_mm": 0.15, "out": again,
    }  # fmt: skip
    with open_pipeline("calibrate", arguments) as pipeline:
        list(pipeline.items())
    one, two = read_calibration(file=guided), read_calibration(file=again)
    np.testing.assert_allclose(one.film.lights, two.film.lights, rtol=1e-4)
    # Within a quarter of a grey level: pixels at a limit of `denoise_flat` may fall on either side.
    np.testing.assert_allclose(one.flat, two.flat, atol=1e-3)


def test_presses_of_an_earlier_session_are_not_mixed_in(guided: Path) -> None:
    with pytest.raises(InputError, match="holds presses already; move it away"):
        next(guide_presses(camera=SCENE, **GIVEN, file=guided))


def test_an_untouched_film_ends_with_a_line_that_says_what_to_do(tmp_path: Path) -> None:
    touches = guide_presses(
        camera=f"{SCENE}&depth_mm=0", **GIVEN, file=tmp_path / "cal.npz", patience_s=4
    )
    with pytest.raises(InputError, match="was not pressed within 4 s; press the ball into it"):
        next(touches)


def test_an_unknown_pixel_size_is_refused_by_names_that_the_user_has(tmp_path: Path) -> None:
    arguments = GIVEN | {"pixel_size_mm": None}
    with pytest.raises(InputError, match="give `pixel_size_mm`=MM, or a `sensor` that states it"):
        next(guide_presses(camera=SCENE, **arguments, file=tmp_path / "cal.npz"))


def test_a_wrong_ball_is_reported_and_not_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(line: str) -> None:
        if line.endswith("press again."):
            raise KeyboardInterrupt(line)

    monkeypatch.setattr("tactograph.rings.live.nodes.guide._watch_film.tell", stop)
    arguments = GIVEN | {"ball_radius_mm": 0.5}
    with pytest.raises(KeyboardInterrupt, match=r"no ball of radius 0\.5 mm is seen: let go"):
        next(guide_presses(camera=SCENE, **arguments, file=tmp_path / "cal.npz"))
    assert not (tmp_path / "cal_presses" / "pressed").exists()


def test_leds_that_flash_by_themselves_are_refused(tmp_path: Path) -> None:
    arguments = GIVEN | {"port": "none"}
    with pytest.raises(InputError, match=r"`port`=none: .* cannot be lit one by one"):
        next(guide_presses(camera=SCENE, **arguments, file=tmp_path / "cal.npz"))


def test_a_burnt_out_led_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tactograph.rings.live.nodes.simulated import simulated_sensor

    made = simulated_sensor.SimulatedSensor.__init__

    def burnt(self: simulated_sensor.SimulatedSensor, *args: object) -> None:
        made(self, *args)  # type: ignore[arg-type]
        self.strength[1] = 0

    monkeypatch.setattr(simulated_sensor.SimulatedSensor, "__init__", burnt)
    with pytest.raises(InputError, match="LED 2 gives no light"):
        next(guide_presses(camera=SCENE, **GIVEN, file=tmp_path / "cal.npz"))


def test_ctrl_c_keeps_the_finished_presses(tmp_path: Path) -> None:
    file = tmp_path / "cal.npz"
    command = [sys.executable, "-m", "tactograph.graph.command", "run", "calibrate_live"]
    command += [f"{name}={value}" for name, value in GIVEN.items()]
    with subprocess.Popen([*command, f"camera={SCENE}", f"out={file}"]) as running:
        until = time.monotonic() + 90
        while not file.exists() and running.poll() is None and time.monotonic() < until:
            time.sleep(0.05)
        running.send_signal(signal.SIGINT)
        assert running.wait(30) == 0
    assert len(read_calibration(file=file).film.lights) == 4
    assert not list(tmp_path.rglob(".writing-*"))


@pytest.mark.parametrize(
    "poor",
    [{"heldout_normal_deg": 2.0}, {"film_covered_percent": 30.0}, {"presses": 2.0}],
    ids=lambda poor: next(iter(poor)),
)
def test_the_session_ends_when_the_calibration_is_good_or_after_so_many_presses(
    poor: Metrics, capsys: pytest.CaptureFixture[str]
) -> None:
    end_when_good(GOOD | poor, "press at the top", ["01", "02", "03"])
    assert "next: press at the top" in capsys.readouterr().out
    with pytest.raises(EndOfStream):
        end_when_good(GOOD, "press more", ["01", "02", "03"])
    with pytest.raises(EndOfStream):
        end_when_good(GOOD | poor, "", ["01", "02"], presses_at_most=2)
    assert "not as good as wanted" in capsys.readouterr().out
