"""Right heights on films that are not matt, under near cameras: rigs in the hand, a real sensor."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tactograph.graph import load
from tactograph.nodes import F4
from tests.fixtures import SHARED, MadeOnce, Raytraced, needs_rings
from tests.pipelines.conftest import run

RIGS = {
    "hand_perspective": 5.0, "hand_lens": 5.0, "hand_bounce": 4.0, "hand_gloss": 5.0, "hand": 8.0,
}  # fmt: skip
"""Root mean square error in um of a ball that is pressed in softly by 2.2 mm."""
PARTS = {
    "hand_perspective": "reconstruct_orthographic",
    "hand_bounce": "reconstruct_no_bounce",
    "hand_gloss": "reconstruct_no_lobe",
}
SHAPE = "sphere_film"
Microns = Callable[..., float]


@pytest.fixture
def microns(raytraced: Raytraced, made_once: MadeOnce) -> Microns:
    """Root mean square error in um of a shape on a rig, by a graph."""

    def measure(rig: str, graph: str = "reconstruct", shape: str = SHAPE) -> float:
        file = made_once(f"{rig}.npz", lambda file: calibrate(raytraced / rig, file))
        capture = raytraced / rig / shape
        result = run(graph, capture=capture, calibration=file)
        true = np.load(capture / "truth_height_mm.npy")
        return 1e3 * float(np.sqrt(np.square(result["height"] - true).mean()))

    return measure


def calibrate(rig: Path, file: Path) -> None:
    """Calibrate with both presses, the lens from the grid on the film, and the pupil as built."""
    scene = json.loads((rig / "calibration/scene.json").read_text())
    presses, camera = file.with_suffix(".presses"), file.with_suffix(".camera.npz")
    presses.mkdir()
    for press in ("calibration", "calibration_off"):
        (presses / press).symlink_to(rig / press)
    run("calibrate_camera", camera, image=rig / "grid.png", pitch_mm=1.5)
    more = {"camera_mm": scene["camera_mm"]} if scene["camera_mm"] else {}
    radius = scene["sphere_radius_mm"]
    images = {"capture": presses, "flat": rig / "flat", "ball_radius_mm": radius, "lens": camera}
    run("calibrate", file, **images, **more)


@needs_rings
@pytest.mark.slow
@pytest.mark.parametrize("rig", RIGS)
def test_a_soft_press_on_a_rig_in_the_hand_is_right(rig: str, microns: Microns) -> None:
    """It is right only with the part of film or camera that describes the rig."""
    right = microns(rig)
    assert right <= RIGS[rig]
    if rig in PARTS:
        assert microns(rig, PARTS[rig]) > 2 * right


@needs_rings
@pytest.mark.slow
def test_the_light_that_a_rim_throws_converges(microns: Microns) -> None:
    """A rigid half ball on a coated film with interreflection; three passes are too few."""
    assert microns("hand", "precise", "sphere") < 18


@pytest.mark.slow
def test_a_stream_finds_the_heights_of_single_touches(
    raytraced: Raytraced, made_once: MadeOnce
) -> None:
    """To the bit wherever the touch has moved, and within 0.2 um while only noise has changed."""
    file = made_once("hand.npz", lambda file: calibrate(raytraced / "hand", file))
    names = sorted((raytraced / "hand" / SHAPE).glob("led*.png"))
    images = np.stack([cv2.imread(str(name), cv2.IMREAD_GRAYSCALE) for name in names])
    rng = np.random.default_rng(0)

    def frame(right_px: int) -> NDArray[np.uint8]:
        noisy = np.roll(images, right_px, axis=2) + rng.normal(0, 0.5, images.shape)
        return np.rint(noisy.clip(0, 255)).astype(np.uint8)

    touches, differs = [0, 0, 0, 3, 3, 6, 9, 9], []
    with (
        load("reconstruct", calibration=file) as single,
        load("reconstruct_stream", calibration=file) as stream,
    ):
        for touch in touches:
            image = frame(touch)
            difference = stream(frames=image)["height"] - single(frames=image)["height"]
            differs.append(bool(difference.any()))
            assert 1e3 * np.sqrt(np.square(difference).mean()) < 0.2
    assert differs == [False, True, True, False, True, False, False, True]


SCALE, PIXEL_MM, RADIUS_MM = 4, 4 * 0.003404, 0.2475
BALL = {"ball_radius_mm": RADIUS_MM, "pixel_size_mm": PIXEL_MM}
BALL_PX = RADIUS_MM / PIXEL_MM


class Sensor(NamedTuple):
    """The real sensor at a quarter of its scale, calibrated with one ball of its first scan."""

    scan: Path
    calibration: Path
    centres: F4
    first_centres: F4
    """The centres in the scan that calibrates."""


@pytest.fixture(scope="module")
def sensor(tmp_path_factory: pytest.TempPathFactory) -> Sensor:
    data = SHARED / "real" / "gelsight_six_led"
    if not data.is_dir():
        pytest.skip("the real captures (../shared/data/real) are not here")
    folder = tmp_path_factory.mktemp("gelsight")
    for name in ("flat", "balls_1", "balls_2"):
        (folder / name).mkdir()
        for image in sorted((data / name).glob("led*.png")):
            fine = cv2.imread(str(image), cv2.IMREAD_UNCHANGED).astype(np.float32)
            size = fine.shape[1] // SCALE, fine.shape[0] // SCALE
            small = cv2.resize(fine, size, interpolation=cv2.INTER_AREA)
            cv2.imwrite(str(folder / name / image.name), np.round(small * 257).astype(np.uint16))
    images = {"capture": folder / "balls_1", "flat": folder / "flat"}
    ball = {"ball_center_px": [253.2, 255.4], "ball_contact_px": 65 / SCALE}
    run("calibrate", folder / "cal.npz", **images, **BALL, **ball)
    centres = (marked(data / f"{name}.csv") for name in ("balls_2", "balls_1"))
    return Sensor(folder / "balls_2", folder / "cal.npz", *centres)


def marked(file: Path) -> F4:
    """The vendor's marks, in px of the smaller images."""
    with file.open() as opened:
        marks = [(float(m["x_px"]), float(m["y_px"])) for m in csv.DictReader(opened)]
    return ((np.array(marks) + 0.5) / SCALE - 0.5).astype(np.float32)


def degrees(height: F4, centres: F4) -> float:
    """Mean angle between the normals of a height and those of balls, placed by the height."""
    q, p = np.gradient(height.astype(np.float64), PIXEL_MM)
    n = np.stack([-p, -q, np.ones_like(p)]) / np.sqrt(1 + p * p + q * q)
    yy, xx = np.mgrid[: height.shape[0], : height.shape[1]]
    angles = []
    for x, y in centres:
        for _ in range(3):
            inside = np.hypot(xx - x, yy - y) < 0.85 * BALL_PX
            x, y = (np.median(a[inside] - BALL_PX * c[inside]) for a, c in ((xx, n[0]), (yy, n[1])))
        u, v = (xx[inside] - x) / BALL_PX, (yy[inside] - y) / BALL_PX
        truth = np.stack([u, v, np.sqrt(np.maximum(1 - u * u - v * v, 1e-4))])
        angles.append(np.degrees(np.arccos(np.clip((n[:, inside] * truth).sum(0), -1, 1))).mean())
    return float(np.mean(angles))


@pytest.mark.slow
def test_one_ball_calibrates_a_real_sensor(sensor: Sensor) -> None:
    """Against all balls of another scan; and no simpler flow is better."""
    errors = {
        graph: degrees(
            run(graph, capture=sensor.scan, calibration=sensor.calibration)["height"],
            sensor.centres,
        )
        for graph in ("precise", "reconstruct", "reconstruct_no_shadow", "paper")
    }
    assert errors["reconstruct"] < 1.75
    assert errors["reconstruct"] < errors["reconstruct_no_shadow"] + 0.005
    assert errors["precise"] < 1.7
    assert errors["paper"] > max(errors["reconstruct"], errors["precise"])


@pytest.fixture(scope="module")
def scans(sensor: Sensor) -> list[dict[str, Any]]:
    """Both scans, with the first one's calibration."""
    folder = sensor.scan.parent
    images = {"capture": folder / "balls_1", "flat": folder / "flat"}
    run("calibrate", folder / "scan.npz", **images, **BALL, ball_pitch_mm=1.0)
    return [
        run("reconstruct", capture=folder / name, calibration=folder / "scan.npz")
        for name in ("balls_1", "balls_2")
    ]


@pytest.mark.slow
def test_scans_of_the_calibrated_sensor_are_trusted(scans: list[dict[str, Any]]) -> None:
    """The scan that calibrates and another one; its own presses show what the model leaves open."""
    assert min(scan["metrics"]["trust"] for scan in scans) > 0.02
