"""What `docs/motion.md` and `docs/force.md` state of simulated touches, and the time of a frame.

    python benchmarks/motion.py                  # half a minute to some minutes
    python benchmarks/motion.py --only times

Objects, noise and truths are those of the tests.  Times are of the processor, medians of 30 frames
of 320 x 240 pixels.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import ClassVar, NamedTuple

import cv2
import numpy as np

from tactograph.graph import load
from tactograph.graph.run.pipeline import Pipeline
from tactograph.graph.run.result import Result
from tactograph.nodes import BAND_DEVIATIONS
from tactograph.nodes.files.height_files import write_tiff
from tactograph.nodes.simulate.expose import expose
from tactograph.nodes.simulate.light_ring import light_ring
from tactograph.nodes.simulate.press import press
from tactograph.nodes.simulate.render import render
from tactograph.nodes.slope.height_slopes import height_slopes
from tactograph.rings.frames.colour_planes import planes_of
from tactograph.rings.live.nodes.simulated.simulated_colour_sensor import (
    ColourScene,
    SimulatedColourSensor,
)
from tactograph.rings.live.nodes.simulated.simulated_sensor import Pressed, read_scene
from tactograph.rings.mechanics.layers.markers import MarkerTracks
from tactograph.rings.mechanics.layers.pose import ObjectPose
from tactograph.rings.mechanics.nodes.force.calibrate_force import calibrate_force
from tactograph.rings.mechanics.nodes.force.drag_to_shear import drag_to_shear
from tactograph.rings.mechanics.nodes.force.press_to_pressure import press_to_pressure
from tactograph.rings.mechanics.nodes.motion.find_slip import find_slip
from tactograph.rings.mechanics.nodes.motion.follow_contacts import follow_contacts
from tactograph.rings.mechanics.nodes.motion.stitch import stitch
from tactograph.rings.mechanics.nodes.motion.track_pose import track_pose

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rings.live.tests import oneshot
from rings.mechanics.tests.force import presses as gel_presses
from rings.mechanics.tests.force.test_drag_to_shear import random_presses
from rings.mechanics.tests.motion import (
    moved_objects,
    test_find_slip,
    test_follow_contacts,
    test_stitch,
)
from rings.mechanics.tests.motion.moved_objects import (
    SIGMA,
    STATED,
    coin,
    moved,
    plate,
    pressed,
    seen,
)
from rings.mechanics.tests.motion.test_track_pose import (
    PLATE_STEP,
    STEP,
    astray,
    pose_of_film,
    track,
    way,
)
from tests.fixtures import simulated_sensor

Row = tuple[str, str]
FRAMES, STREAM_FRAMES, CONTACT_FRAMES, STUCK_FRAMES = 30, 60, 10_000, 1000
BAND_STREAMS, BAND_FRAMES, WRONG_MM = 24, 6, 0.02
SIZE, PIXEL = (240, 320), 0.05
REAL, GRAIN_PX = Path(__file__).resolve().parents[1] / "../shared/data/real", 40
SURE_RESPONSE = 0.5
FAMILIES = {"chosen on": 5, "judged by": 105}
HANGING_POSES, HANGING_MM, HANGING_WAY = 40, 0.5, np.array([0.5, 0.5, 0.02, 1, 1, 4])
STITCHES, PRESSES, WEIGHED = 6, 14, 3
"""Surfaces, presses of each gel, and parts of these that a modulus is found from."""
PRESSED_GELS = (
    ((4.0, 0.48), (2.0, 0.48), (8.0, 0.48)),
    ((3.0, 0.45), (1.5, 0.5), (6.0, 0.48)),
)
"""Of both families: thickness in mm, and Poisson's ratio."""


def contacts() -> Iterator[Row]:
    """Contacts that pass one another, split, merge, come and go."""
    triples = test_follow_contacts.numbers_over(CONTACT_FRAMES)
    once = len(triples) == 1 and len({*min(triples)}) == 3
    value = "none" if once else f"{len(triples)} assignments of 3 numbers"
    yield f"{CONTACT_FRAMES:,} frames of contacts: numbers lost or swapped", value


def poses() -> Iterator[Row]:
    """A textured dome by steps, and a plate larger than the film."""
    for name, shape, step, count in (("dome", coin, STEP, 8), ("plate", plate, PLATE_STEP, 24)):
        motions, surfaces = way(shape, step, count)
        off = [astray(*each) for each in zip(track(surfaces), motions, strict=True)]
        errors = np.abs(np.diff(off, axis=0)).max(axis=0)
        yield (
            f"pose, {name}: largest error of a step",
            f"{1e3 * errors[:3].max():.1f} um, {errors[3:].max():.3f} degrees",
        )
        drift, length = np.hypot(*off[-1][:2]), np.hypot(*motions[-1][:2, 3])
        yield (
            f"pose, {name}: drift of the way",
            f"{1e3 * drift:.1f} um of {length:.1f} mm ({100 * drift / length:.2f} %)",
        )


def slips() -> Iterator[Row]:
    """A dome that is dragged while a front runs inwards, and one that moves with the film."""
    state, _, _, true = test_find_slip.front(test_find_slip.Film(coin))
    partly, wholly = test_find_slip.onsets(state, true)
    yield "slip: onset of partial and of whole slip", f"{partly:+d}, {wholly:+d} frames"
    _, *figures = test_find_slip.stuck(STUCK_FRAMES)
    false = sum(each["contact_slip/c1"] > 0 for each in figures)
    yield f"slip: told in {STUCK_FRAMES:,} frames of an object that is stuck", f"{false}"


def surfaces() -> Iterator[Row]:
    """Nine touches of a plate of 31 x 24 mm."""
    heights, errors = test_stitch.noisy_touches()
    whole, single = stitch(heights, errors, moved_objects.PIXEL, test_stitch.NAMES), errors.mean()
    together = float(np.sqrt(np.nanmean(np.square(test_stitch.levelled(whole)))))
    yield (
        "surface of nine touches: RMSE",
        f"{1e3 * together:.2f} um ({together / single:.2f} of a touch's)",
    )
    yield "surface of nine touches: in the 90 % band", f"{100 * test_stitch.held(whole):.0f} %"


def forces() -> Iterator[Row]:
    """200 presses that drag and turn."""
    inside, off = random_presses()
    shares = " ".join(f"{100 * share:.0f}" for share in np.mean(inside, axis=0))
    yield "shear x, y, torque: in the 90 % band", f"{shares} %"
    yield "shear: median error", f"{100 * np.median(off):.1f} %"


def times() -> Iterator[Row]:
    """Nodes at 320 x 240, on contacts of 18,000 pixels and on the whole frame."""
    moved_objects.SHAPE, moved_objects.PIXEL = SIZE, PIXEL
    stated = np.full((2, *SIZE), SIGMA**2, np.float32)
    for shape in (plate, coin):
        rng = np.random.default_rng(3)
        motions = moved(0, 0, 0, 0, 0, 0), moved(0.1, -0.06, 0.02, 0.2, -0.3, 1.1)
        first, second = (seen(pressed(shape, motion), rng) for motion in motions)
        key = track_pose(*first, PIXEL, stated)[2:4]
        touched = f"{second[1].sum():,} px"
        took = milliseconds(track_pose, *second, PIXEL, stated, *key)
        yield f"track_pose, {touched}", took
    height, contact = second
    state = follow_contacts(first[1], PIXEL)
    yield f"follow_contacts, {touched}", milliseconds(follow_contacts, contact, PIXEL, *state[:2])
    rows = np.mgrid[12:240:24, 16:320:24].reshape(2, -1)[::-1].T
    markers = np.column_stack([rows, np.full(len(rows), 2)]).astype(np.float32)
    shift = rng.normal(2, 0.5, rows.shape).astype(np.float32)
    tracks = MarkerTracks(markers, shift, np.ones(len(rows), np.uint8))
    moving = track_pose(*second, PIXEL, stated, *key)
    pose = ObjectPose(moving.pose, moving.covariance)
    many = f"{len(rows)} markers"
    yield f"find_slip, {many}", milliseconds(find_slip, height, contact, tracks, pose, PIXEL)
    error, gel = np.full(SIZE, 0.004, np.float32), {"modulus_kpa": 200.0, "thickness_mm": 3.0}
    pressing = partial(press_to_pressure, height, contact, PIXEL, error, **gel)
    yield "press_to_pressure, with deviation", milliseconds(pressing)
    dragged = height, contact, pressing().pressure, tracks, PIXEL
    yield f"drag_to_shear, {many}", milliseconds(partial(drag_to_shear, **gel), *dragged)


class Rig:
    """A simulated sensor, calibrated into `folder`."""

    leds: ClassVar = {"slant_deg": 33.0, "distance_mm": 60.0}

    def __init__(self, folder: str) -> None:
        moved_objects.SHAPE, moved_objects.PIXEL = SIZE, PIXEL
        size = {"width_px": SIZE[1], "height_px": SIZE[0], "pixel_size_mm": PIXEL}
        files = simulated_sensor(Path(folder), radius_mm=3.0, **size, **self.leds)
        self.calibration, self.lights = str(files / "cal.npz"), light_ring(**self.leds)

    def frame(self, motion: np.ndarray, seed: int) -> np.ndarray:
        """What the camera sees of the dome."""
        film = press(pressed(coin, motion).astype(np.float32), PIXEL)
        return expose(render(film, PIXEL, self.lights).light, seed=seed).image


def streams() -> Iterator[Row]:
    """`reconstruct` without and with the pose, in turns on frames of a dome that moves."""
    # To and fro on a circle, leaning and turning.
    motions = [
        moved(np.sin(t), 1 - np.cos(t), 0, np.sin(t), 0, 8 * np.sin(t))
        for t in 2 * np.pi * np.arange(STREAM_FRAMES) / STREAM_FRAMES
    ]
    names, poses = ("reconstruct", "reconstruct_pose"), []
    took: list[list[tuple[float, float]]] = [[], []]
    with tempfile.TemporaryDirectory() as folder:
        rig = Rig(folder)
        pipelines = [load(name, calibration=rig.calibration) for name in names]
        for number, motion in enumerate(motions):
            frame = rig.frame(motion, number)
            for each, pipeline in zip(took, pipelines, strict=True):
                start = time.process_time(), time.perf_counter()
                found = pipeline(frames=frame)
                each.append((time.process_time() - start[0], time.perf_counter() - start[1]))
            poses.append(found["pose"])
    for name, each in zip(names, took, strict=True):
        processor, wall = np.median(each[2:], axis=0)
        value = f"{1e3 * processor:.1f} ms of the processor, {1 / wall:.0f} a second"
        yield f"stream of moving frames, {name}", value
    off = departures(poses, motions, motions[0])
    yield "stream of moving frames: largest error of the pose", largest(off)


def departures(
    poses: list[np.ndarray], motions: list[np.ndarray], first: np.ndarray
) -> list[np.ndarray]:
    """Poses less the truth since the `first` motion, in mm and degrees."""
    back = np.linalg.inv(first)
    return [
        moved_objects.shift_and_turn(moved(*pose) @ np.linalg.inv(motion @ back))
        for pose, motion in zip(poses, motions, strict=True)
    ]


def bands() -> Iterator[Row]:
    """Short streams of `reconstruct` that jump by up to 2 mm, 3 degrees of tilt and 12 of turn."""
    rng, deviations, sure, off = np.random.default_rng(3), [], [], []
    with tempfile.TemporaryDirectory() as folder:
        rig = Rig(folder)
        pipeline = load("reconstruct_pose", calibration=rig.calibration)
        for seed in range(0, BAND_STREAMS * BAND_FRAMES, BAND_FRAMES):
            # Nothing touches, so the next frame begins anew.
            pipeline(frames=rig.frame(moved(0, 0, -5, 0, 0, 0), seed))
            ways = rng.uniform(-1, 1, (BAND_FRAMES, 6)) * [0.8, 0.8, 0.03, 1.2, 1.2, 6]
            motions = [moved(*way) for way in ways]
            found = [pipeline(frames=rig.frame(m, seed + n)) for n, m in enumerate(motions)][1:]
            off += departures([each["pose"] for each in found], motions[1:], motions[0])
            deviations += [np.sqrt(np.diag(each["covariance"])) for each in found]
            sure += [each["metrics"]["pose_sure"] for each in found]
    inside = np.abs(off) < 1.645 * np.array(deviations)
    shares = " ".join(f"{100 * share:.0f}" for share in np.mean(inside, axis=0))
    yield f"{len(off)} jumps: truths in the 90 % band, x, y, z, turns", f"{shares} %"
    wrong = np.hypot(*np.array(off)[:, :2].T) > WRONG_MM
    counts = f"{wrong.sum()}, {(wrong & (np.array(sure) > 0)).sum()} of them said to be sure"
    yield f"{len(off)} jumps: wrong by more than {1e3 * WRONG_MM:.0f} um", counts
    yield f"{len(off)} jumps: largest error", largest(off)


def tight() -> Iterator[Row]:
    """Tilts of 2 degrees under films of different reach."""
    for reach_mm in (0.5, 1.0, 2.0):
        rng, held = np.random.default_rng(5), []
        for angle in 0.3 + np.pi / 2 * np.arange(4):
            tilt = 2 * np.array([np.cos(angle), np.sin(angle)])
            motions = [np.eye(4), moved(0.2, 0.1, 0, *tilt, 3)]
            found = pose_of_film(motions, rng, STATED, reach_mm)
            held.append(-25 * astray(found, motions[1])[3:5] @ tilt)
        row = f"film that returns to rest over {reach_mm:g} mm: tilts too small by"
        yield (
            row,
            f"{min(held):.0f} to {max(held):.0f} %, pressed {found.figures['pose_pressed']:.2f}",
        )


def hanging() -> Iterator[Row]:
    """Film that hangs 0.5 mm over; poses by the film's stated slopes."""
    for family, seed in FAMILIES.items():
        rng, inside, off = np.random.default_rng(seed), [], []
        for _ in range(HANGING_POSES):
            motions = [moved(*(rng.uniform(-1, 1, 6) * HANGING_WAY)) for _ in range(2)]
            found = pose_of_film(motions, rng, STATED, HANGING_MM)
            off.append(astray(found, motions[1] @ np.linalg.inv(motions[0])))
            inside.append(np.abs(off[-1]) < BAND_DEVIATIONS * np.sqrt(np.diag(found.covariance)))
        shares = " ".join(f"{100 * share:.0f}" for share in np.mean(inside, axis=0))
        value = f"{shares} %, all {100 * np.mean(inside):.0f} %; {largest(off)}"
        yield f"pose, film hangs {HANGING_MM} mm over, {family}: x, y, z, turns in the band", value


def tilted() -> Iterator[Row]:
    """Five touches of a plate, tilted by about a degree."""
    for family, seed in FAMILIES.items():
        stitched = [test_stitch.tilted_parts(seed + n) for n in range(STITCHES)]
        shares = [test_stitch.held(*each) for each in stitched]
        off = [np.sqrt(np.nanmean(test_stitch.departure(*each) ** 2)) for each in stitched]
        each = " ".join(f"{100 * share:.0f}" for share in shares)
        yield (
            f"surface of five tilted touches, {family}: in the band",
            f"{each} %, all {100 * np.mean(shares):.0f} %; {1e3 * min(off):.1f} to "
            f"{1e3 * max(off):.1f} um off",
        )


def presses() -> Iterator[Row]:
    """Forces from images of balls on gels, and the gels' moduli from their heights."""
    with tempfile.TemporaryDirectory() as folder:
        rig = Rig(folder)
        pipeline = load("precise", calibration=rig.calibration)
        for (family, seed), gels in zip(FAMILIES.items(), PRESSED_GELS, strict=True):
            forces, moduli = [], []
            for number, gel in enumerate(gels):
                rng = np.random.default_rng(seed + number)
                pressed = [pressed_ball(pipeline, rig, gel, rng) for _ in range(PRESSES)]
                forces.append([each.force() for each in pressed])
                yield in_band(f"force from images, gel {gel[0]:g} mm, {family}", forces[-1])
                moduli += [weighed(pressed[n::WEIGHED], Path(folder)) for n in range(WEIGHED)]
            yield in_band(f"force from images, {family}", np.concatenate(forces))
            yield in_band(f"modulus without thickness, {family}", moduli)


class PressedBall(NamedTuple):
    """A ball's press on a gel of a thickness in mm and a Poisson's ratio."""

    gel: tuple[float, float]
    newtons: float
    found: Result

    def force(self) -> tuple[float, float]:
        """By how much the force is off, and its deviation, as shares of it."""
        maps = (self.found[name] for name in ("height", "contact"))
        gel = {"thickness_mm": self.gel[0], "poisson": self.gel[1]}
        params = {"modulus_kpa": gel_presses.MODULUS, "error": self.found["error"], **gel}
        figures = press_to_pressure(*maps, PIXEL, **params).figures
        force, deviation = (figures[f"contact_force_{each}/c1"] for each in ("n", "sd_n"))
        return force / self.newtons - 1, deviation / self.newtons


def pressed_ball(
    pipeline: Pipeline, rig: Rig, gel: tuple[float, float], rng: np.random.Generator
) -> PressedBall:
    radius, peak = rng.uniform(0.8, 2.4), rng.uniform(20, 50)
    film = gel_presses.height(*gel, radius, peak, SIZE, PIXEL)
    image = expose(render(film, PIXEL, rig.lights).light, seed=int(rng.integers(2**31))).image
    newtons = gel_presses.FORCE * (radius / gel_presses.RADIUS) ** 2 * peak / gel_presses.PEAK
    return PressedBall(gel, newtons, pipeline(frames=image))


def weighed(pressed: list[PressedBall], folder: Path) -> tuple[float, float]:
    """By how much a modulus without a thickness is off, and its stated error."""
    with tempfile.TemporaryDirectory(dir=folder) as results:
        for number, each in enumerate(pressed):
            (Path(results) / f"{number}").mkdir()
            write_tiff(Path(results) / f"{number}" / "height.tiff", each.found["height"], PIXEL)
        forces = tuple(each.newtons for each in pressed)
        settings = {"force_n": forces, "poisson": pressed[0].gel[1]}
        figures = calibrate_force(results=Path(results), **settings)
    return figures["modulus_kpa"] / gel_presses.MODULUS - 1, figures["modulus_error"]


def in_band(what: str, rows: list[tuple[float, float]]) -> Row:
    off, stated = np.transpose(rows)
    inside = np.mean(np.abs(off) < BAND_DEVIATIONS * stated)
    value = f"{100 * inside:.0f} % of {len(off)}; off {100 * off.min():+.1f} to "
    value += f"{100 * off.max():+.1f} %, stated {100 * np.median(stated):.1f} %"
    return f"{what}: in the band", value


def grain() -> Iterator[Row]:
    """Whether the texture of real bare film tells where film at rest is, by phase correlation."""
    mini, six = REAL / "gelsight_mini_balls", REAL / "gelsight_six_led"
    films = {
        "Mini": (mini / "background.png", sorted(mini.glob("*/*/gelsight.png"))),
        "bench, LED 1": (six / "flat/led1.png", sorted(six.glob("balls_?/led1.png"))),
    }
    window = cv2.createHanningWindow((GRAIN_PX, GRAIN_PX), cv2.CV_32F)
    for name, (flat, touches) in films.items():
        first, near = textured(flat) if touches else None, []
        for plane in map(textured, touches):
            for y, x in GRAIN_PX * np.argwhere(np.ones(np.floor_divide(SIZE, GRAIN_PX))):
                patch = np.s_[y : y + GRAIN_PX, x : x + GRAIN_PX]
                shift, sure = cv2.phaseCorrelate(first[patch].copy(), plane[patch].copy(), window)
                near.append((np.hypot(*shift) < 1, sure > SURE_RESPONSE))
        if near:
            found, sure = np.array(near).T
            among = 100 * found[sure].mean() if sure.any() else 0
            value = f"{100 * found.mean():.0f} % of the patches; response above "
            value += f"{SURE_RESPONSE} in {100 * sure.mean():.0f} %, {among:.0f} % of them found"
            yield f"texture of a real film ({name}): found at rest within 1 px", value


def textured(file: Path) -> np.ndarray:
    """Logarithm of an image, less what is wider than 3 px."""
    light = cv2.imread(str(file)).astype(np.float32).mean(axis=2)
    logs = np.log(np.maximum(cv2.resize(light, SIZE[::-1], interpolation=cv2.INTER_AREA), 1))
    return logs - cv2.GaussianBlur(logs, (0, 0), 3)


class Moved(SimulatedColourSensor):
    """A simulated one-shot sensor under an object that the caller moves."""

    motion = np.eye(4)

    def _pressed(self, moment: float) -> Pressed:
        height = press(pressed(coin, self.motion).astype(np.float32), oneshot.PIXEL_MM)
        slope = height_slopes(height, oneshot.PIXEL_MM).slope
        return Pressed(height, slope, np.ones_like(height))


def one_shot() -> Iterator[Row]:
    """The pose from heights of `gelsight_mini`, which state no variance."""
    oneshot.PIXEL_MM = 0.0634
    oneshot.BY_HAND = (
        "simulated?width_px=320&height_px=240&pixel_size_mm=0.0634&radius_mm=3&depth_mm=0.8"
        "&by_hand=true&path_mm=8&press_s=0.8&rest_s=4"
    )
    moved_objects.SHAPE, moved_objects.PIXEL = SIZE, oneshot.PIXEL_MM
    sensor = Moved(read_scene(oneshot.BY_HAND, ColourScene), start=0.0)
    off, stated = [], []
    with tempfile.TemporaryDirectory() as folder:
        oneshot.calibrated(Path(folder) / "cal.npz")
        pipeline = load("gelsight_mini_pose", calibration=str(Path(folder) / "cal.npz"))
        for n in range(FRAMES):
            sensor.motion = moved(0.05 * n, -0.03 * n, 0, 0, 0, 0.4 * n)
            found = pipeline(frames=planes_of(sensor.picture(n, n), "bgr", 255))
            if n:
                off += departures([found["pose"]], [sensor.motion], np.eye(4))
                stated.append(np.sqrt(np.diag(found["covariance"])))
    yield "one-shot, a textured dome: largest error", largest(off)
    ratios = np.sqrt(np.mean((np.array(off) / stated) ** 2, axis=0))[[0, 1, 3, 4, 5]]
    value = " ".join(f"{ratio:.1f}" for ratio in ratios)
    yield "one-shot: error over its deviation, x, y, turns", value


def largest(off: list[np.ndarray]) -> str:
    """Largest of six errors over all frames."""
    worst = np.max(np.abs(off), axis=0)
    return (
        f"{1e3 * worst[:2].max():.0f} um, {worst[5]:.2f} degrees about z, "
        f"{worst[3:5].max():.2f} about x and y"
    )


def milliseconds(call: Callable[..., object], *arguments: object) -> str:
    """Median of the processor's time."""
    call(*arguments)
    took = []
    for _ in range(FRAMES):
        start = time.process_time()
        call(*arguments)
        took.append(time.process_time() - start)
    return f"{1e3 * np.median(took):.1f} ms"


KINDS = contacts, poses, slips, surfaces, forces, times, streams, bands, tight, grain, one_shot
KINDS += presses, hanging, tilted
PARTS = {part.__name__: part for part in KINDS}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=PARTS)
    only = parser.parse_args().only
    print("| measured | |\n| --- | --- |")
    for name, part in PARTS.items():
        if only in (None, name):
            for row, value in part():
                print(f"| {row} | {value} |", flush=True)


if __name__ == "__main__":
    main()
