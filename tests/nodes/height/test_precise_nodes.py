"""Shadows and weights, on surfaces whose heights are known exactly."""

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from tactograph.nodes import F4, ShadowRises
from tactograph.nodes.height import springs
from tactograph.nodes.height.height_equations import HeightSystem
from tactograph.nodes.height.height_system import height_system
from tactograph.nodes.height.integrate_weighted import integrate_weighted
from tactograph.nodes.height.settle_loose import settle_loose
from tactograph.nodes.height.springs import Springs, Ties
from tactograph.nodes.light.calm_film import calm_film
from tactograph.nodes.light.rest_mask import rest_mask
from tactograph.nodes.shadow.cast_shadows import cast_shadows
from tactograph.nodes.shadow.majority_labels import majority_labels
from tactograph.nodes.shadow.shadow_constraints import shadow_constraints
from tactograph.nodes.slope.height_slopes import height_slopes
from tactograph.nodes.slope.pixel_mean_slope import pixel_mean_slope
from tests.nodes.scenes import LIGHTS, lambert

PIXEL = 0.1
SHAPE = (40, 64)
NO_RISES = ShadowRises(
    np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0, np.float32), np.zeros(0, np.uint8)
)


def plateau(height_mm: float = 0.5) -> F4:
    """A block with vertical walls in the middle of the film."""
    z = np.zeros(SHAPE, np.float32)
    z[12:28, 20:36] = height_mm
    return z


def dome() -> tuple[F4, F4]:
    """A smooth bump inside the frame, and its slope."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float) * PIXEL
    r2 = ((x - 3.2) ** 2 + (y - 2.0) ** 2) / 0.6**2
    z = 0.3 * np.exp(-r2)
    slope = np.stack([-2 * (x - 3.2) / 0.36 * z, -2 * (y - 2.0) / 0.36 * z])
    return z.astype(np.float32), slope.astype(np.float32)


def at_rest(z: F4, margin: int = 3) -> NDArray[np.uint8]:
    rest = np.ones(SHAPE, np.uint8)
    rows, columns = np.nonzero(np.abs(z) > 1e-4)
    rest[
        max(rows.min() - margin, 0) : rows.max() + margin + 1,
        max(columns.min() - margin, 0) : columns.max() + margin + 1,
    ] = 0
    return rest


def distant_led(elevation_deg: float, azimuth_deg: float = 0.0) -> F4:
    up, around = np.radians(elevation_deg), np.radians(azimuth_deg)
    far = 1e4
    direction = [np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)]
    return far * np.array([direction], np.float32)


def variance_of(value: float) -> F4:
    return np.full((2, *SHAPE), value, np.float32)


def equations(
    slope: F4,
    variance: float | F4,
    rest: NDArray[np.uint8],
    rises: ShadowRises = NO_RISES,
    mask: NDArray[np.uint8] | None = None,
    **settings: float,
) -> HeightSystem:
    """The equations of slopes with this variance, film at rest and shadows for the height."""
    if isinstance(variance, float):
        variance = variance_of(variance)
    system: HeightSystem = height_system(slope, variance, rest, PIXEL, rises, mask, **settings)
    return system


def test_a_steps_shadow_is_as_long_as_equation_1_says() -> None:
    shadow = cast_shadows(plateau(0.5), distant_led(45), PIXEL)
    assert shadow[20].sum() == pytest.approx(5, abs=1)
    assert not shadow[20, 20:].any()


@pytest.mark.parametrize("side", [1, -1], ids=["LED above", "LED below, opposite"])
def test_a_steps_shadow_measures_its_height_and_no_shadow_measures_none(side: int) -> None:
    z = plateau(0.5)
    led = side * distant_led(30, 0)
    shadow = cast_shadows(z, led, PIXEL)
    light = (1 - shadow)[None].astype(np.float32)
    used, clear = np.full(SHAPE, 0b111, np.uint8), np.zeros(1, np.float32)
    known = used, np.zeros((2, *SHAPE), np.float32), 0 * z, led, PIXEL, clear
    rises = shadow_constraints(light, shadow, *known)
    assert len(rises.rise) >= 14
    step = z.ravel()[rises.top] - z.ravel()[rises.foot]
    assert np.allclose(step, 0.5)
    assert np.median(rises.rise) == pytest.approx(0.5, abs=0.5 * PIXEL)
    none = shadow_constraints(np.ones_like(light), 0 * shadow, *known)
    assert [part.size for part in none] == [0, 0, 0, 0]


def test_exact_slopes_give_the_exact_surface_and_the_film_at_rest_stays_at_zero() -> None:
    z, slope = dome()
    rest = at_rest(z)
    height = integrate_weighted(equations(slope, 1e-6, rest), np.zeros_like(z), steps=30)
    assert np.abs(height - z).max() < 0.01 * PIXEL
    noisy = slope + np.random.default_rng(1).normal(0, 0.02, slope.shape).astype(np.float32)
    height = integrate_weighted(equations(noisy, 4e-4, rest), z)
    assert np.abs(height[rest > 0]).max() < 1e-5


def test_a_ring_without_slopes_is_bridged_by_shadows() -> None:
    z = plateau(0.5)
    rim = np.zeros(SHAPE, bool)
    rim[10:30, 18:38] = True
    rim[14:26, 22:34] = False
    variance = np.where(rim, np.float32(1e12), np.float32(1e-6)) * np.ones((2, 1, 1), np.float32)
    rows = np.arange(14, 26)
    top, foot = rows * SHAPE[1] + 22, rows * SHAPE[1] + 12
    rises = ShadowRises(
        top.astype(np.int32),
        foot.astype(np.int32),
        np.full(12, 0.5, np.float32),
        np.ones(12, np.uint8),
    )
    level = np.zeros((2, *SHAPE), np.float32)
    known = level, variance.astype(np.float32), at_rest(z)
    lying = integrate_weighted(equations(*known), level[0])
    standing = integrate_weighted(equations(*known, rises), level[0], steps=30)
    assert np.abs(lying[16:24, 24:32]).max() < 0.02
    assert np.abs(standing[16:24, 24:32] - 0.5).max() < 0.02


def test_the_rise_of_a_wall_next_to_dark_pixels_is_uncertain() -> None:
    slope, variance = np.zeros((2, *SHAPE), np.float32), variance_of(1e-6)
    slope[0, :, 24] = -30
    variance[:, :, 25:30] = 1e12
    system = equations(slope, variance, np.zeros(SHAPE, np.uint8))
    assert system.right[:, 24] == pytest.approx(-30 * PIXEL)
    assert (system.right_variance[:, 24] > (30 * PIXEL) ** 2).all()


def test_outliers_are_rejected() -> None:
    z, slope = dome()
    spoilt = slope.copy()
    rng = np.random.default_rng(3)
    spoilt[:, rng.random(SHAPE) < 0.03] = 3.0
    known, flat = (spoilt, 1e-6, at_rest(z)), np.zeros_like(z)
    robust = integrate_weighted(equations(*known, bend=0.0), flat, rounds=8, steps=15, ease=2.0)
    plain = integrate_weighted(equations(*known, bend=0.0, robust=1e6), flat, rounds=1, steps=60)
    assert np.abs(robust - z).mean() < 0.2 * np.abs(plain - z).mean()


@pytest.mark.parametrize(("share", "least", "most"), [(0.4, 0.2, 0.25), (1.0, 0.49, 0.52)])
def test_rises_are_outvoted_only_while_most_of_them_agree(
    share: float, least: float, most: float
) -> None:
    """A plateau of 0.5 mm whose walls seem to be 0.2 mm high, as `share` of its shadows deny.

    Then the walls err alike, and the shadows together decide.  Its outermost pixels share the wall.
    """
    pixels, seen = np.arange(plateau().size, dtype=np.int32).reshape(SHAPE), plateau(0.2)
    down, right = (np.diff(seen, axis=axis, append=0) / np.float32(PIXEL) for axis in (0, 1))
    top, foot = (pixels[rows, 21:35].ravel() for rows in ([13, 26], [10, 29]))
    rise = np.where(np.arange(28) < 28 * share, np.float32(0.5), np.float32(0.2))
    rises = ShadowRises(top, foot, rise, np.ones(28, np.uint8))
    system = equations(np.stack([right, down]), 1e-4, at_rest(seen), rises)
    height = integrate_weighted(system, seen, rounds=8, steps=20)
    assert least < np.median(height[14:26, 22:34]) < most


def counted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of cycles of all later calls of the solver."""
    counts: list[int] = []
    plain = springs.cycle

    def cycle(levels: Sequence[Springs], force: F4, depth: int = 0) -> F4:
        counts[-1] += depth == 0
        return plain(levels, force, depth)

    monkeypatch.setattr(springs, "cycle", cycle)
    return counts


def test_a_film_that_changes_little_is_solved_faster_from_the_previous_height(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Twenty touches, each a hundredth higher, from zero and from the previous height."""
    counts = counted(monkeypatch)
    z, slope = dome()
    noise = np.random.default_rng(5).normal(0, 0.003, slope.shape).astype(np.float32)
    before, cold_cycles, warm_cycles = None, 0, 0
    for size in 1 + 0.01 * np.arange(20, dtype=np.float32):
        problem = equations(size * slope + noise, 1e-5, at_rest(z)), 0.7 * size * z
        counts.append(0)
        cold = integrate_weighted(*problem, ease=4.0)
        cold_cycles += counts[-1]
        counts.append(0)
        warm = integrate_weighted(*problem, before, ease=4.0)
        warm_cycles += counts[-1]
        assert np.abs(warm - cold).max() < 0.003 * PIXEL
        before = warm
    assert warm_cycles < 0.7 * cold_cycles


def test_the_previous_height_is_ignored_for_another_touch() -> None:
    z, slope = dome()
    problem = equations(slope, 1e-5, at_rest(z)), z
    other = integrate_weighted(*problem, np.roll(z, 12, axis=1))
    assert np.array_equal(other, integrate_weighted(*problem))


def test_masked_pixels_change_nothing() -> None:
    z, slope = dome()
    mask = np.ones(SHAPE, np.uint8)
    mask[16:19, 30:36] = 0
    wild = np.where(mask, slope, np.float32(3)).astype(np.float32)
    top, foot = np.array([17 * SHAPE[1] + 32], np.int32), np.array([5], np.int32)
    wrong = ShadowRises(top, foot, np.array([2], np.float32), np.array([1], np.uint8))
    system = equations(wild, 1e-6, at_rest(z), wrong, mask)
    height = integrate_weighted(system, 0 * z, steps=30)
    assert not height[mask == 0].any()
    assert np.abs(height - z)[mask == 1].max() < 0.02 * PIXEL


def test_parts_that_a_mask_separates_are_solved_independently() -> None:
    """The left part is held by the film at rest, the right by nothing; no light moves it."""
    z, slope = dome()
    mask = np.ones(SHAPE, np.uint8)
    mask[:, 40:42] = 0
    rest = at_rest(z)
    rest[:, 40:] = 0
    height = integrate_weighted(equations(slope, 1e-6, rest, NO_RISES, mask), z, steps=30)
    assert np.abs(height - z)[mask == 1].max() < 0.02 * PIXEL


def test_a_touch_without_any_film_at_rest_has_a_border_at_zero() -> None:
    z, slope = dome()
    nowhere = np.zeros(SHAPE, np.uint8)
    height = integrate_weighted(equations(slope, 1e-6, nowhere), z + 1, steps=30)
    assert np.abs(height - z).max() < 0.02 * PIXEL


def test_without_a_touch_everything_is_at_rest() -> None:
    rng = np.random.default_rng(2)
    light = rng.normal(1, 0.01, (4, *SHAPE)).astype(np.float32)
    rest = rest_mask(calm_film(light, np.full_like(light, 0.01)), PIXEL)
    assert rest.all()
    none = np.zeros((2, *SHAPE), np.float32)
    assert not integrate_weighted(equations(none, 1.0, rest), none[0]).any()


def test_a_flat_top_is_not_the_film_at_rest() -> None:
    calm = np.ones(SHAPE, np.uint8)
    calm[10:30, 20:44] = 0
    calm[14:26, 24:40] = 1
    rest = rest_mask(calm, PIXEL, margin_mm=2 * PIXEL)
    assert not rest[14:26, 24:40].any()
    assert rest[:7].all()


def test_a_flat_top_that_reaches_the_border_is_not_the_film_at_rest() -> None:
    """Its height above the rest tells; a bar between two halves at rest leaves both at zero."""
    height = np.zeros(SHAPE, np.float32)
    height[:, 40:] = 0.2
    calm = np.ones(SHAPE, np.uint8)
    calm[:, 36:40] = 0
    assert not rest_mask(calm, PIXEL, height, margin_mm=0.0)[:, 40:].any()
    height[:, 40:], height[:, 37:39] = 0.05, 0.2
    rest = rest_mask(calm, PIXEL, height, margin_mm=0.0)
    assert (rest == rest_mask(calm, PIXEL, margin_mm=0.0)).all()
    assert rest[:, 40:].all()


def test_the_gentle_skirt_of_a_press_is_not_pinned_to_zero() -> None:
    """A film returns to rest as exp(-d / reach); below 5 sigma it looks calm."""
    x = np.arange(SHAPE[1], dtype=np.float32) * PIXEL
    z = 0.3 * np.exp(-np.maximum(x - 1, 0) / 0.5)
    p = np.tile(np.gradient(z, PIXEL), (SHAPE[0], 1)).astype(np.float32)
    light = lambert(np.stack([p, np.zeros_like(p)])) / LIGHTS[:, 2, None, None]
    noisy = light + np.random.default_rng(3).normal(0, 0.01, light.shape).astype(np.float32)
    calm = calm_film(noisy, np.full_like(light, 0.01))
    column = np.argmax(rest_mask(calm, PIXEL).any(axis=0))
    assert z[column] < 0.002 < z[np.argmax(rest_mask(calm, PIXEL, margin_mm=0.0).any(axis=0))]


def test_film_at_rest_is_calm_where_neighbours_share_noise() -> None:
    """Noise of pixels in blocks of 2 x 2: a mean over many has four times the variance."""
    blocks = np.random.default_rng(3).normal(0, 0.01, (4, SHAPE[0] // 2, SHAPE[1] // 2))
    light = (1 + np.kron(blocks, np.ones((2, 2)))).astype(np.float32)
    sigma = np.full_like(light, 0.01)
    assert calm_film(light, sigma).mean() < 0.97
    assert calm_film(light, sigma, 4.0).all()
    one_pixel = calm_film(np.full_like(light, 1.07), sigma, 4.0, radius_px=0)
    assert not one_pixel.any(), "one pixel is as calm as its own noise"


def test_one_pixel_is_outvoted() -> None:
    shadow = np.zeros(SHAPE, np.uint8)
    shadow[5:15, 5:15] = 0b10
    holed = shadow.copy()
    holed[9, 9] = 0
    assert majority_labels(holed)[9, 9] == 0b10


def test_the_mean_slope_exceeds_the_slope_of_the_mean_normal() -> None:
    """Slopes of normals averaged over each pixel, on a cylinder, against the true mean slope."""
    fine, radius = 64, 5.0
    x = (np.arange(SHAPE[1] * fine) + 0.5) / fine * PIXEL - 3.2
    p = -x / np.sqrt(radius**2 - x**2)
    normal = np.stack([-p, np.ones_like(p)]) / np.sqrt(1 + p * p)
    nx, nz = normal.reshape(2, -1, fine).mean(axis=2)
    mean = p.reshape(-1, fine).mean(axis=1)
    slope = np.zeros((2, *SHAPE), np.float32)
    slope[0] = -nx / nz
    corrected = pixel_mean_slope(slope)[0, 0]
    inner = slice(2, -2)
    assert np.abs(corrected - mean)[inner].max() < 0.3 * np.abs(slope[0, 0] - mean)[inner].max()


@pytest.mark.parametrize("axis", [0, 1])
def test_differences_over_two_pixels_become_the_slope_of_the_mean_normal(axis: int) -> None:
    """On waves, against normals averaged over each pixel, rows and columns alike."""
    fine = 15
    z, dense = ((_waves(np.arange(SHAPE[1] * by), by)) for by in (1, fine))
    slopes = np.array(np.gradient(dense, PIXEL / fine))[::-1]
    square = np.sqrt(1 + (slopes**2).sum(axis=0))
    normal = np.stack([*-slopes / square, 1 / square]).reshape(3, SHAPE[1], fine, SHAPE[1], fine)
    nx, ny, nz = normal.mean(axis=(2, 4))
    shown = -(nx, ny)[axis] / nz
    known = height_slopes(z, PIXEL).slope
    corrected = pixel_mean_slope(known, inverse=True)[axis]
    inner = np.s_[4:-4, 4:-4]
    off, before = (np.abs(each - shown)[inner].max() for each in (corrected, known[axis]))
    assert off < 0.15 * before


def _waves(pixels: F4, by: int) -> F4:
    """Waves across both axes, 12 and 15 px long, in the middle of `by` parts of a pixel."""
    at = (pixels + 0.5) / by
    return np.float32(0.1 * np.sin(at[:, None] / 2.4) * np.sin(at / 1.9))


def test_a_loose_spike_settles_and_a_ridge_stays() -> None:
    z = np.zeros(SHAPE, np.float32)
    z[20, 30] = 1
    z[5] = 1
    settled = settle_loose(z, variance_of(1.0))
    assert settled[20, 30] == 0
    assert (settled[5] == 1).all()
    assert np.array_equal(settle_loose(z, variance_of(0.01)), z)


def test_the_coarser_network_keeps_the_stiffness_of_its_springs() -> None:
    """It also joins ties between blocks; single pixels at the border are blocks, too."""
    rng = np.random.default_rng(4)
    right, down, ground = (
        rng.uniform(0.1, 1, shape).astype(np.float32) for shape in ((13, 16), (12, 17), (13, 17))
    )
    stiff = np.array([0.7, 0.3, 0.5], np.float32)
    ties = Ties(np.array([3, 20, 40]), np.array([50, 67, 220]), stiff)
    springs = Springs(right, down, ground, ties)
    coarser = springs.coarser()
    assert coarser.ties.stiffness.tolist() == pytest.approx([1.0, 0.5])
    z = rng.uniform(size=(7, 9)).astype(np.float32)
    fine = z.repeat(2, axis=0).repeat(2, axis=1)[:13, :17]
    energies = np.vdot(fine, springs.apply(fine)), np.vdot(z, coarser.apply(z))
    assert energies[0] == pytest.approx(energies[1], 1e-5)
