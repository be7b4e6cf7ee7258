"""The light that a film throws on itself, where geometry or a ray tracer gives the truth."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tactograph.graph import InputError
from tactograph.nodes import F4, Film
from tactograph.nodes.calibrate.ball.ball_surface import ball_height
from tactograph.nodes.light.film_bounce import film_bounce
from tactograph.nodes.optics.coat import let_in
from tactograph.nodes.optics.radiosity import cell_grid

RAYTRACED = Path(__file__).resolve().parents[3].parent / "shared/data/raytraced"
PIXEL = 0.1
FAR = np.float32([[0, 0, 1e5], [2e4, 0, 1e5], [0, -3e4, 1e5]])
"""LEDs so far away that they light the film evenly."""


def film(albedo: float, lights: F4 = FAR, **coat: float) -> Film:
    return Film.matt(lights)._replace(albedo=albedo, **coat)


def ones(height: F4) -> F4:
    return np.ones((len(FAR), *height.shape), np.float32)


def distance(side: int) -> F4:
    """side x side, mm from the middle."""
    y, x = np.indices((side, side)) - (side - 1) / 2
    return np.float32(PIXEL * np.hypot(x, y))


def bump(side: int = 120, radius: float = 2.5, rise: float = 1.0) -> F4:
    """A ball's cap on the film."""
    inside = np.maximum(radius**2 - distance(side) ** 2, 0)
    return np.maximum(np.sqrt(inside) - radius + rise, 0).astype(np.float32)


@pytest.mark.parametrize("level", [0.0, 1.3])
def test_a_flat_film_throws_no_light_on_itself(level: float) -> None:
    height = np.full((40, 50), level, np.float32)
    bounce = film_bounce(ones(height), height, film(0.9, rim=0.0), PIXEL)
    assert (bounce == 0).all()


def imprint(depth: float, radius: float = 4.0) -> tuple[F4, NDArray[np.bool_]]:
    """A ball's imprint in the film, and where it is."""
    inside = distance(121) < np.sqrt(2 * radius * depth - depth**2)
    below = radius - depth - np.sqrt(np.maximum(radius**2 - distance(121) ** 2, 0))
    middle = cv2.erode(inside.astype(np.uint8), np.ones((7, 7), np.uint8)) == 1
    return np.where(inside, below, 0).astype(np.float32), middle


@pytest.mark.parametrize("depth", [0.3, 0.6, 1.2])
def test_a_ball_s_imprint_is_lit_evenly_by_its_own_area(depth: float) -> None:
    # Inside a sphere every point lights every other alike: by its area over that of the sphere.
    height, middle = imprint(depth)
    bounce = film_bounce(ones(height), height, film(0.6), PIXEL, cells=121 * 121)
    expected = 0.6 * depth / (2 * 4.0)
    assert bounce[:, middle].mean() == pytest.approx(expected, rel=0.06)
    assert bounce[:, middle].std() < 0.04 * expected


def test_under_a_near_led_film_that_is_lit_more_throws_more() -> None:
    # Inside the sphere the sum still is the same everywhere, so that its share is not.
    height, middle = imprint(1.2)
    lights = np.float32([[-4, 0, 9]])
    bounce = film_bounce(ones(height)[:1], height, film(0.6, lights), PIXEL, cells=121 * 121)[0]
    y, x = (np.indices((121, 121)) - 60) * PIXEL
    rest = ((x + 4) ** 2 + y**2 + 9**2) ** -1.5
    assert bounce[middle].std() > 0.1 * bounce[middle].mean()
    assert (bounce * rest)[middle].std() < 0.04 * (bounce * rest)[middle].mean()


def test_a_slope_sees_the_film_at_rest_below_its_own_plane() -> None:
    # A plane seen at an angle from the normal fills (1 - cos) / 2 of what a slope sees.
    height, albedo = bump(), 0.5
    p = np.gradient(height, PIXEL, axis=1)
    bounce = film_bounce(ones(height), height, film(albedo, rim=50.0), PIXEL, cells=120 * 120)
    ring = (distance(120) > 1.4) & (distance(120) < 1.8)
    q = np.gradient(height, PIXEL, axis=0)
    expected = albedo * (1 - 1 / np.sqrt(1 + p * p + q * q)) / 2
    assert bounce[0][ring].mean() == pytest.approx(expected[ring].mean(), rel=0.12)


def test_film_behind_a_wall_lights_nothing() -> None:
    # A floor between two walls sees the nearer slope of either, not the bright film behind.
    height = np.zeros((90, 90), np.float32)
    height[:, 30:33] = height[:, 57:60] = 1.5
    dark, bright = np.ones((1, 90, 90), np.float32), np.ones((1, 90, 90), np.float32)
    bright[:, :, :28] = bright[:, :, 62:] = 50
    matt = film(0.7, FAR[:1], rim=0.0)
    open_, closed = (
        film_bounce(light, height, matt, PIXEL, cells=8100) for light in (bright, dark)
    )
    np.testing.assert_allclose(open_[0, 20:70, 38:52], closed[0, 20:70, 38:52], rtol=1e-5)
    height[:, 30:33] = 0
    open_, closed = (
        film_bounce(light, height, matt, PIXEL, cells=8100) for light in (bright, dark)
    )
    assert open_[0, 45, 57] > 3 * closed[0, 45, 57]


def test_no_concave_film_throws_more_than_falls_on_it() -> None:
    # Deep in a pit film fills nearly all directions: the sum stays below the half-space.
    y, x = (np.indices((100, 100)) - 49.5) * PIXEL
    height = np.where(np.hypot(x, y) < 1.5, -6, 0).astype(np.float32)
    bounce = film_bounce(ones(height), height, film(0.9), PIXEL, cells=10000)
    covered = 1 - 1.5**2 / (1.5**2 + 6**2)
    assert bounce[:, 48:52, 48:52].max() < 0.9
    assert bounce[:, 48:52, 48:52].mean() == pytest.approx(0.9 * covered, rel=0.03)


def test_film_beyond_the_frame_lights_film_inside() -> None:
    height = bump(60)
    without, with_rim = (
        film_bounce(ones(height), height, film(0.7, rim=r), PIXEL).mean() for r in (0.0, 4.0)
    )
    assert with_rim > 1.1 * without


def test_the_bounce_grows_with_albedo_and_light_alike() -> None:
    height = bump()
    light = np.random.default_rng(0).random((3, *height.shape), np.float32)
    once, more, brighter = (
        film_bounce(gain * light, height, film(albedo, rim=0.0), PIXEL)
        for gain, albedo in ((1, 0.4), (1, 0.8), (2, 0.4))
    )
    np.testing.assert_allclose(more, 2 * once, rtol=1e-5)
    np.testing.assert_allclose(brighter, 2 * once, rtol=1e-5)


def test_the_number_of_cells_hardly_matters() -> None:
    height = bump(160, radius=6.0, rise=2.0)
    few, many = (film_bounce(ones(height), height, film(0.7), PIXEL, cells=c) for c in (1600, 6400))
    assert np.abs(few - many).mean() < 0.1 * many.mean()
    assert few.shape == many.shape == (3, 160, 160)


@pytest.mark.parametrize("columns", [100, 120, 200, 320, 500, 2464])
def test_cells_are_as_fine_on_frames_of_any_size(columns: int) -> None:
    grid = cell_grid((columns * 3 // 4, columns), 1 / columns, cells=80 * 60, rim_mm=0.0)
    assert 2 / 3 <= 80 * grid.width <= 4 / 3


def test_the_previous_bounce_is_kept_while_nothing_moves() -> None:
    height = bump()
    previous = np.full_like(ones(height), 0.1)
    moved, first, stays = (
        film_bounce(ones(height), height, film(0.5), PIXEL, recall=before, still=still)
        for before, still in ((previous, 0.0), (None, 1.0), (previous, 1.0))
    )
    assert np.array_equal(moved, first)
    assert stays is previous


def test_a_film_that_reflects_nothing_has_no_bounce() -> None:
    height = bump()
    assert film_bounce(ones(height), height, film(0.0), PIXEL) is None
    assert np.abs(film_bounce(ones(height), height, film(1e-6), PIXEL)).max() < 1e-6


@pytest.mark.parametrize("albedo", [-0.1, 1.0, np.nan])
def test_an_albedo_that_no_film_has_is_refused(albedo: float) -> None:
    height = bump(20)
    with pytest.raises(InputError, match="albedo is"):
        film_bounce(ones(height), height, film(albedo), PIXEL)


def test_a_round_changes_the_previous_bounce_by_a_share_of_the_way() -> None:
    height = bump()
    now = film_bounce(ones(height), height, film(0.7), PIXEL)
    before = np.random.default_rng(0).random(now.shape, np.float32)
    bounce = film_bounce(ones(height), height, film(0.7), PIXEL, before, share=0.25)
    np.testing.assert_allclose(bounce, 0.75 * before + 0.25 * now, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("coat", [{}, {"base": 0.7, "roughness": 0.2, "refraction": 1.5}])
def test_cells_twice_as_large_find_nearly_the_same_light(coat: dict[str, float]) -> None:
    (height, inside), lights = imprint(1.2), np.float32([[-6, 2, 20], [5, 5, 25]])
    light, of = ones(height)[:2], film(0.7, lights, **coat)
    fine, coarse = (
        film_bounce(light, height, of, PIXEL, cells=cells)[:, inside].mean()
        for cells in (121 * 121, 61 * 61)
    )
    assert coarse == pytest.approx(fine, rel=0.025)


def test_a_coat_without_refraction_reflects_as_a_matt_film() -> None:
    (height, inside), lights = imprint(1.2), np.float32([[-6, 2, 20], [5, 5, 25]])
    light = ones(height)[:2]
    nearly = film(0.7, lights, base=0.7, roughness=0.3, refraction=1 + 1e-4)
    # Matt film looks along half as many azimuths.
    matt = film_bounce(light, height, film(0.7, lights), PIXEL, azimuths=64)
    bounce = film_bounce(light, height, nearly, PIXEL, azimuths=32)
    np.testing.assert_allclose(bounce[:, inside], matt[:, inside], rtol=0.02)


@pytest.mark.parametrize("near", [1 / 60, 1 / 30])
def test_a_camera_near_the_film_sees_the_light_that_one_far_away_sees(near: float) -> None:
    # A ball off the middle, by the height that each ray meets.
    cx, cy, _ = centre = 2.0, -1.0, -2.4
    v, u = (np.indices((160, 160)) - 79.5) * PIXEL

    def bounced(camera: float) -> tuple[F4, F4]:
        z = np.maximum(ball_height(u, v, centre, 4.0, camera), 0)
        z[np.hypot(u * (1 - camera * z) - cx, v * (1 - camera * z) - cy) > 4] = 0
        apparent = (z / (1 - camera * z)).astype(np.float32)
        matt = film(0.7, camera=camera, rim=4.0)
        return z, film_bounce(ones(apparent), apparent, matt, PIXEL, cells=6400)[0]

    z, bounce = bounced(near)
    x, y = (w * (1 - near * z) for w in (u, v))
    expected = cv2.remap(
        bounced(0.0)[1], *((w / PIXEL + 79.5).astype(np.float32) for w in (x, y)), cv2.INTER_LINEAR
    )
    on_ball = (np.hypot(x - cx, y - cy) < 2.8) & (z > 0.1)
    assert np.abs(bounce - expected)[on_ball].mean() < 0.008 * expected[on_ball].mean()


def test_a_coat_in_a_shadow_mirrors_no_led() -> None:
    height, led = bump(160, radius=3.0, rise=1.8), np.float32([[5.8e4, 0, 1e5]])
    coat = {"base": 0.7, "roughness": 0.2, "refraction": 1.5}
    light = ones(height)[:1]
    shadowed, lit = (
        film_bounce(share * light, height, film(0.7, led, rim=0.0, **coat), PIXEL)
        for share in (1e-4, 1)
    )
    assert shadowed.max() < 1e-3 * lit.max()


def test_a_coat_mirrors_an_led_over_the_top_to_the_film_behind() -> None:
    # Light from 60 degrees above leaves film that leans 30 degrees away from it level.
    height, led = bump(160, radius=3.0, rise=1.8), np.float32([[5.8e4, 0, 1e5]])
    coats = [{"base": base, "roughness": 0.2, "refraction": 1.5} for base in (50.0, 0.7)]
    dull, glossy = (
        film_bounce(ones(height)[:1], height, film(0.7, led, **coat), PIXEL)[0] for coat in coats
    )
    x = (np.indices((160, 160))[1] - 79.5) * PIXEL
    foot = np.abs(distance(160) - 3.3) < 0.3
    sides = [foot & (side * x > 2) for side in (1, -1)]
    lit, behind = (glossy[side].mean() / dull[side].mean() for side in sides)
    assert behind > 1.5 > 1.1 > lit


def test_less_light_of_a_coated_film_reaches_film_that_it_grazes() -> None:
    # A mirror too rough to show: only the light that the coat lets in and out remains.
    height = bump(120, rise=0.1)
    coat = {"base": 5.0, "roughness": 0.1, "refraction": 1.5}
    matt, coated = (film_bounce(ones(height), height, film(0.7, **c), PIXEL)[0] for c in ({}, coat))
    ring = (distance(120) > 0.3) & (distance(120) < 0.6)
    grazing = let_in(np.float32(0.1), coat["roughness"], coat["refraction"])
    assert coated[ring].mean() < grazing * matt[ring].mean()


def relative_light(rig: str, scene: str) -> tuple[F4, dict[str, float]]:
    """Light relative to the untouched film, which is smoothed, and the facts of the scene."""

    def images(name: str) -> list[F4]:
        folder = RAYTRACED / rig / name
        planes = (cv2.imread(str(folder / f"led{k}.png"), -1) for k in range(1, 5))
        return [np.asarray(plane, np.float32) for plane in planes]

    rest = [cv2.GaussianBlur(plane, (0, 0), 6) for plane in images("flat")]
    facts = json.loads((RAYTRACED / rig / scene / "scene.json").read_text())
    return np.stack([i / r for i, r in zip(images(scene), rest, strict=True)]), facts


@pytest.mark.skipif(not RAYTRACED.is_dir(), reason=f"no ray-traced captures in {RAYTRACED}")
@pytest.mark.parametrize(
    ("scene", "most"),
    [
        ("calibration", 0.003),
        ("calibration_off", 0.004),
        ("sphere_film", 0.004),
        ("corner_film", 0.005),
        ("teapot_film", 0.004),
        ("cat_film", 0.008),
    ],
)
def test_subtracting_the_bounce_gives_a_ray_tracers_film_without_it(
    scene: str, most: float
) -> None:
    light, facts = relative_light("hand_bounce", scene)
    alone, _ = relative_light("hand_ideal", scene)
    height = np.load(RAYTRACED / "hand_bounce" / scene / "truth_height_mm.npy")
    lights, pixel = np.float32(facts["lights_mm"]), facts["pixel_size_mm"]
    bounced = film_bounce(light, height, film(0.7, lights), pixel, cells=4800)

    def cells(image: F4) -> F4:
        return cv2.resize(image, (80, 60), interpolation=cv2.INTER_AREA)

    def rms(residual: F4) -> float:
        return float(np.sqrt(np.mean([cells(plane)[calm] ** 2 for plane in residual])))

    steep = np.float32(np.hypot(*np.gradient(height, pixel)) > 1.2)
    calm = (cells(steep) == 0) & (cells(height) > 0.02)
    assert rms(light - alone) > 5 * most
    assert rms(light - bounced - alone) < most


def test_drawn_from_above_a_matt_film_is_lit_as_under_a_distant_camera() -> None:
    height = bump()
    near, far = film(0.7)._replace(camera=1 / 30), film(0.7)
    bounce = film_bounce(ones(height), height, near, PIXEL, from_above=True)
    np.testing.assert_array_equal(bounce, film_bounce(ones(height), height, far, PIXEL))
    oblique = film_bounce(ones(height), height, near, PIXEL)
    assert np.abs(oblique - bounce).max() > 0.02 * bounce.max()
