"""A surface larger than the film, from touches of its parts."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from rings.batch.tests.stores import new_store
from rings.mechanics.tests.motion.moved_objects import (
    F8,
    PIXEL,
    Shape,
    ball,
    cylinder,
    height_at,
    moved,
    plate,
    pressed,
    seen,
    shift_and_turn,
)
from rings.recording.tests.recordings import LEDS, record_touch
from tactograph.graph import InputError, Provenance, Session
from tactograph.graph.errors import collect_warnings
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.graph.run.progress import progress_text
from tactograph.nodes import F4
from tactograph.nodes.optics.camera_view import View
from tactograph.nodes.stream.touch import Touch
from tactograph.nodes.write.write_result import write_result
from tactograph.rings.batch.entry import DONE, Entry
from tactograph.rings.batch.map_types import MapType
from tactograph.rings.frames.live_frames import RawFrame
from tactograph.rings.mechanics.layers.pose import POSE_NAMES
from tactograph.rings.mechanics.nodes.motion.read_touches import read_touches
from tactograph.rings.mechanics.nodes.motion.stitch import StitchedSurface, stitch
from tests.fixtures import Calibration, Raytraced

COUNT = 9
NAMES = [str(number) for number in range(COUNT)]


def motions() -> list[F8]:
    """Three by three places of the object on the film, each turned and tilted a little."""
    rng, found = np.random.default_rng(4), []
    for row in (-1, 0, 1):
        for column in (-1, 0, 1):
            shift = np.array([8.0 * column, 6.0 * row, 0.0]) + rng.normal(0, 0.3, 3) * [1, 1, 0.1]
            found.append(moved(*shift, *(rng.normal(0, 1, 3) * [0.3, 0.3, 3])))
    return found


def noisy_touches() -> tuple[F4, F4]:
    """Heights with noise, and their errors."""
    rng = np.random.default_rng(6)
    true = np.array([pressed(plate, motion) for motion in motions()])
    heights = np.array([seen(z, rng)[0] for z in true])
    return heights, np.full_like(heights, np.sqrt(np.square(heights - true).mean()))


touches = pytest.fixture(scope="module")(noisy_touches)


@pytest.fixture(scope="module")
def whole(touches: tuple[F4, F4]) -> StitchedSurface:
    return stitch(*touches, PIXEL, NAMES)


def tilted_parts(seed: int) -> tuple[StitchedSurface, list[F8]]:
    """Five touches in a cross, tilted by about a degree, and the object's motions."""
    rng, ways = np.random.default_rng(seed), [(0, 0), (-6, -4), (6, -4), (-6, 4), (6, 4)]
    motions = [moved(*way, 0, *(rng.normal(0, 1, 3) * [1, 1, 3])) for way in ways]
    true = np.array([pressed(plate, motion) for motion in motions])
    heights = np.array([seen(z, rng)[0] for z in true])
    errors = np.full_like(heights, np.sqrt(np.square(heights - true).mean()))
    return stitch(heights, errors, PIXEL, NAMES[: len(ways)]), motions


def root_of(whole: StitchedSurface) -> int:
    """The touch in whose coordinates the surface is."""
    zeros = [n for n in range(COUNT) if whole.figures.get(f"stitched_x_mm/{n}") == 0]
    return zeros[0]


def departure(whole: StitchedSurface, places: list[F8] | None = None) -> F8:
    """Height less truth, in the coordinates of the root."""
    root = root_of(whole)
    rows, columns = whole.height.shape
    # The grid begins where the object's touched part does, in the root's coordinates.
    y, x = np.indices((rows, columns)) * PIXEL
    x, y = x + whole.figures["stitched_left_mm"], y + whole.figures["stitched_top_mm"]
    return np.asarray(whole.height - height_at(plate, (places or motions())[root], x, y))


def levelled(whole: StitchedSurface) -> F8:
    """The same without how it leans, which is a choice of the root's."""
    apart = departure(whole)
    known = np.isfinite(apart)
    plane = np.column_stack([*np.nonzero(known), np.ones(known.sum())])
    return np.asarray(apart[known] - plane @ np.linalg.lstsq(plane, apart[known], rcond=None)[0])


def held(whole: StitchedSurface, places: list[F8] | None = None) -> float:
    """Share of the surface in its 90 % band."""
    apart = departure(whole, places)
    known = np.isfinite(apart)
    return float(np.mean(np.abs(apart[known]) < 1.645 * whole.error[known]))


def test_nine_touches_are_as_true_as_one_and_the_error_holds(
    whole: StitchedSurface, touches: tuple[F4, F4]
) -> None:
    assert whole.figures["stitched_touches"] == COUNT
    assert whole.figures["stitched_pairs"] >= 12
    assert whole.figures["stitched_area_mm2"] > 2.5 * touches[0][0].size * PIXEL**2
    assert np.sqrt(np.nanmean(levelled(whole) ** 2)) < 1.3 * touches[1].mean()
    assert 0.8 < held(whole) < 0.97
    assert whole.figures["stitched_difference"] == pytest.approx(1, abs=0.3)


@pytest.mark.slow
def test_the_error_holds_of_tilted_touches() -> None:
    """One surface errs as a whole, so its share is one draw."""
    assert 0.8 < np.mean([held(*tilted_parts(seed)) for seed in range(5, 9)]) < 0.97


def test_poses_are_those_of_the_object(whole: StitchedSurface) -> None:
    root = motions()[root_of(whole)]
    for name, motion in zip(NAMES, motions(), strict=True):
        pose = moved(*(whole.figures[f"stitched_{axis}/{name}"] for axis in POSE_NAMES))
        apart = shift_and_turn(pose @ motion @ np.linalg.inv(root))
        assert np.all(np.abs(apart) < [0.01, 0.01, 0.02, 0.1, 0.1, 0.1])


def test_each_touch_has_its_part(whole: StitchedSurface) -> None:
    assert set(np.unique(whole.source)) == {*range(COUNT + 1)}
    assert np.array_equal(whole.source > 0, np.isfinite(whole.height))


def test_a_touch_of_another_object_is_left_out_and_named(touches: tuple[F4, F4]) -> None:
    rng = np.random.default_rng(8)
    other = seen(pressed(lambda x, y: plate(y + 31, -x), np.eye(4)), rng)[0]
    heights = np.stack([*touches[0][:2], other])
    with collect_warnings([]) as messages:
        found = stitch(heights, touches[1][:3], PIXEL, ["one", "two", "stranger"])
    assert found.figures["stitched_touches"] == 2
    assert messages == ["stitch: touches that fit no other are left out: stranger"]


def test_without_stated_errors_touches_tell_their_own(touches: tuple[F4, F4]) -> None:
    heights = touches[0][:2]
    found = stitch(heights, np.full_like(heights, np.nan), PIXEL, ["one", "two"])
    single = np.median(found.error[found.source == 1])
    assert single == pytest.approx(touches[1].mean(), rel=0.5)


@pytest.mark.parametrize("shape", [ball, cylinder])
def test_places_that_the_shape_does_not_tell_are_named(shape: Shape) -> None:
    rng = np.random.default_rng(4)
    way = [moved(0.7 * n, -0.4 * n, 0, 0, 0, 3 * n) for n in range(3)]
    heights = np.array([seen(pressed(shape, motion), rng)[0] for motion in way])
    with collect_warnings([]) as messages:
        found = stitch(heights, np.full_like(heights, 0.002), PIXEL, ["a", "b", "c"])
    (line,) = messages
    assert "places are not stated" in line
    unsure = [found.figures[f"stitched_unsure_mm/{name}"] for name in "abc"]
    assert sorted(unsure)[1] > 4 * PIXEL


def test_textured_touches_are_sure(whole: StitchedSurface) -> None:
    assert all(whole.figures[f"stitched_unsure_mm/{name}"] < 2 * PIXEL for name in NAMES)


def test_a_time_limit_reports_the_untried_pairs(touches: tuple[F4, F4]) -> None:
    heights, errors = touches[0][:3], touches[1][:3]
    refused = pytest.raises(InputError, match="no two of 3 touches fit")
    with collect_warnings([]) as messages, refused:
        stitch(heights, errors, PIXEL, ["one", "two", "three"], seconds=1e-9)
    assert "3 likely pairs of touches were left untried" in messages[0]
    assert progress_text() == "touch 3 of 3 compared with all others"


def test_each_touch_is_matched_with_a_few_neighbours(monkeypatch: pytest.MonkeyPatch) -> None:
    """The number of fits grows as n log n, not as the number of pairs."""
    rng, tried = np.random.default_rng(5), []
    surface = seen(pressed(plate, np.eye(4)), rng)[0][::3, ::3]
    heights = np.stack([surface] * 32)
    name = "tactograph.rings.mechanics.nodes.motion.stitch.fit_motion"
    monkeypatch.setattr(name, lambda first, *_, **__: tried.append(first))
    with pytest.raises(InputError, match="no two of 32"):
        stitch(heights, np.full_like(heights, 0.002), 3 * PIXEL, [str(n) for n in range(32)])
    assert 0 < len(tried) < 4 * 32 * (4 + 5)


def test_touches_without_anything_in_common_are_refused(touches: tuple[F4, F4]) -> None:
    heights, errors = touches[0][[0, 8]], touches[1][:2]
    with pytest.raises(InputError, match="no two of 2 touches fit together"):
        stitch(heights, errors, PIXEL, ["one", "two"])


def result(folder: Path, **maps: F4) -> None:
    """What `stitch` reads of a result."""
    folder.mkdir(parents=True)
    for name, plane in maps.items():
        np.save(folder / f"{name}.npy", plane)
    (folder / "result.json").write_text(json.dumps({"pixel_size_mm": PIXEL}))


def test_results_of_a_folder_become_one(touches: tuple[F4, F4], tmp_path: Path) -> None:
    for number, name in enumerate(("one", "two")):
        maps = {"height": touches[0][number], "error": touches[1][number]}
        result(tmp_path / "results" / name, **maps)
    arguments = {"over": str(tmp_path / "results"), "out": tmp_path / "whole", "ply": True}
    (found,) = open_pipeline("stitch", arguments).items()
    about = json.loads((tmp_path / "whole/result.json").read_text())
    assert about["metrics"]["stitched_touches"] == 2
    assert np.array_equal(np.load(tmp_path / "whole/height.npy"), found["height"], equal_nan=True)
    assert {"error.npy", "height.ply", "source.png", "seams.png"} <= {*about["files"]}


def test_touches_of_a_store_are_read(touches: tuple[F4, F4], tmp_path: Path) -> None:
    kind = MapType(touches[0].shape[1:], "float32", "mm", ("H", "W"), PIXEL)
    store = new_store(tmp_path / "out.zarr", {"height": kind, "error": kind}, 2)
    store.append(["touches/one", "touches/two"])
    for number in range(2):
        maps = {"height": touches[0][number], "error": touches[1][number]}
        store.write({number: Entry(DONE, maps=maps)})
    found = read_touches(folder=tmp_path / "out.zarr")
    assert found.names == ["one", "two"]
    assert found.pixel == pytest.approx(PIXEL)
    np.testing.assert_array_equal(found.heights, touches[0][:2])
    np.testing.assert_array_equal(found.errors, touches[1][:2])


def test_touches_through_a_lens_are_put_on_the_even_grid(
    touches: tuple[F4, F4], tmp_path: Path
) -> None:
    """Results as a camera near the film sees them."""
    view, height = (
        View(np.array([-0.03, 0.01, 0.02, -0.01, 0, 0.01, 0.02, 0.01], np.float32), 1 / 65),
        touches[0][0],
    )
    touch = Touch(height, np.ones((4, *height.shape), np.float32), PIXEL, view=view)
    made_by = Provenance({"name": "toy"}, None, [], {}, {}, [], [])
    for name in "a", "b":
        write_result(touch, folder=tmp_path / name, provenance=made_by, pictures=False)
    even, _ = view.on_even_grid(height, [])
    np.testing.assert_allclose(read_touches(folder=tmp_path).heights[1], even, atol=1e-5)


def test_frames_of_a_recording_become_one(
    raytraced: Raytraced, calibration: Calibration, tmp_path: Path
) -> None:
    """One press three times: made into heights by the calibration, and put together."""
    press = raytraced / "near33" / "cat_film"
    files = [str(press / f"led{led}.png") for led in range(1, LEDS + 1)]
    images, session = [cv2.imread(file, cv2.IMREAD_UNCHANGED) for file in files], Session()
    for touch in range(3):
        first = LEDS * touch
        frames = [
            RawFrame(first + k, k + 1, 1000 + (first + k) / 30, image)
            for k, image in enumerate(images)
        ]
        record_touch(session, frames, f"{touch:06}", folder=tmp_path / "frames")
    session.close()
    arguments = {"over": str(tmp_path / "frames"), "out": tmp_path / "whole"}
    with pytest.raises(InputError, match="or a recording with its sensor's"):
        list(open_pipeline("stitch", arguments).items())
    doubtful = tmp_path / "cal.npz"
    with np.load(calibration("near33")) as file:
        about = {**json.loads(str(file["about"])), "doubts": ["the ball was an egg"]}
        np.savez(doubtful, **{**file, "about": np.array(json.dumps(about))})
    arguments |= {"calibration": doubtful, "most": 2}
    (found,) = open_pipeline("stitch", arguments).items()
    (warning,) = [line for line in found.warnings if "doubtful" in line]
    assert "the ball was an egg" in warning
    assert found["metrics"]["stitched_touches"] == 2
    assert found["metrics"]["stitched_x_mm/00002"] == pytest.approx(0, abs=1e-3)
    truth = np.load(press / "truth_height_mm.npy")
    assert np.nanmax(found["height"]) == pytest.approx(truth.max(), abs=0.1)


def test_results_that_differ_in_size_are_refused(tmp_path: Path) -> None:
    for size in (20, 21):
        result(tmp_path / str(size), height=np.zeros((size, 20), np.float32))
    with pytest.raises(InputError, match=r"21: differs in size or pixel size from .*20"):
        read_touches(folder=tmp_path)


def test_an_error_below_zero_is_refused(tmp_path: Path) -> None:
    plane = np.zeros((20, 20), np.float32)
    for name in ("one", "two"):
        result(tmp_path / name, height=plane, error=plane - 1)
    with pytest.raises(InputError, match="a standard deviation cannot be negative"):
        read_touches(folder=tmp_path)
