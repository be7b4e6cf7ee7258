"""The stated error of a height, on surfaces whose heights are known exactly."""

from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, uniform_filter1d

from tactograph.nodes import F4, Film, ShadowRises
from tactograph.nodes.error._slope_errors import (
    UNSHARP_SHARE,
    Unperturbed,
    _shown as shown_light,
    folds,
    mixing,
)
from tactograph.nodes.error.doubt_rest import doubt_rest
from tactograph.nodes.error.height_error import LOG_BIAS, _smooth_deviation, height_error
from tactograph.nodes.height.height_equations import HeightSystem
from tactograph.nodes.height.integrate_weighted import integrate_weighted
from tests.nodes.height.test_precise_nodes import (
    PIXEL,
    SHAPE,
    at_rest,
    distant_led,
    dome,
    equations,
    plateau,
    variance_of,
)

UNEVEN = 0.03


def exact(lights: F4) -> F4:
    """The other places of LEDs whose places are exact."""
    return np.repeat(lights[None], 8, axis=0)


def stated_error(
    z: F4,
    slope: F4,
    noise: float,
    others: F4 | None = None,
    system: HeightSystem | None = None,
    refraction: float = 1.0,
    diffuse: float = 0.0,
    **settings: Any,
) -> F4:
    """The stated error of a height whose slopes come from four LEDs of this noise."""
    lights = np.concatenate([distant_led(60, azimuth) for azimuth in (0, 90, 180, 270)])
    film = Film.matt(lights)._replace(
        other_lights=exact(lights) if others is None else others,
        uneven=UNEVEN,
        refraction=refraction,
        diffuse=np.full(4, diffuse, np.float32),
    )
    system = system or equations(slope, 1e-4, at_rest(z))
    noisy, used = np.full((4, *SHAPE), noise, np.float32), np.full(SHAPE, 15, np.uint8)
    settings = {"misfit": np.zeros(5, np.float32), "apparent": slope} | settings
    return np.asarray(height_error(z, slope, system, noisy, used, film, **settings))


def far_from_rest(z: F4) -> NDArray[np.bool_]:
    """Film some pixels away from film at rest, which holds the height beside it."""
    free = (at_rest(z) == 0).astype(np.uint8)
    return cv2.erode(free, np.ones((7, 7), np.uint8)) > 0


def error_of(z: F4, slope: F4, brightness: float, correlation: float | None = None) -> F4:
    """The error of a dome's height when `brightness` times more photons arrive."""
    noise, system = 0.01 / np.sqrt(brightness), equations(slope, 1e-4, at_rest(z), bend=0.0)
    return stated_error(z, slope, noise, system=system, correlation=correlation)


def test_the_error_shrinks_with_the_root_of_the_light() -> None:
    z, slope = dome()
    dim, bright = error_of(z, slope, 1), error_of(z, slope, 100)
    inside = at_rest(z) == 0
    assert np.allclose(dim[inside], 10 * bright[inside], rtol=1e-2)
    assert not dim[~inside].any()


def test_the_error_grows_with_the_noise_that_neighbours_share() -> None:
    z, slope = dome()
    alone, shared = error_of(z, slope, 1), error_of(z, slope, 1, correlation=4.0)
    assert np.allclose(shared, 2 * alone, rtol=1e-2)


def test_blur_spreads_the_error_of_an_edge() -> None:
    z, slope = plateau(), np.zeros((2, *SHAPE), np.float32)
    sharp, blurred = (stated_error(z, slope, 1e-6, blur=blur) for blur in (0, 1.0))
    rim = sharp > 0.5 * sharp.max()
    assert np.allclose(blurred[rim], np.sqrt(13) * sharp[rim], rtol=0.05)


def test_a_share_is_left_of_what_a_blur_flattens_by_half_its_variance_times_the_laplacian() -> None:
    """Averaged over neighbours as all errors are; no other slope of a gentle matt film is wrong."""
    rest, (z, slope) = at_rest(dome()[0]), (np.float32(0.1) * part for part in dome())
    stated = stated_error(z, slope, 1e-6, system=equations(slope, 1e-4, rest), blur=0.8)
    flatter = 0.32 * cv2.Laplacian(z, cv2.CV_32F)
    free = (rest == 0).astype(np.float32)
    lost = _smooth_deviation(cv2.blur(flatter * flatter, (3, 3)), free)
    much = (rest == 0) & (lost > 0.3 * lost[rest == 0].max())
    assert stated[much] == pytest.approx(UNSHARP_SHARE * lost[much], rel=0.1)


def test_a_blur_changes_a_coats_light_by_half_its_variance_times_the_laplacian() -> None:
    z, slope = (np.float32(0.5) * part for part in dome())
    lights = np.concatenate([distant_led(60, azimuth) for azimuth in (0, 90, 180, 270)])
    film = Film.matt(lights)._replace(refraction=np.float32(1.5), roughness=np.float32(0.3))
    y, x = (PIXEL * (np.arange(n, dtype=np.float32) - (n - 1) / 2) for n in SHAPE)
    used, none = np.full(SHAPE, 15, np.uint8), np.zeros((4, *SHAPE), np.float32)
    sigma = none + np.float32(0.01)
    at = Unperturbed(sigma, slope, z, x[None], y[:, None], used, used > 0, none, none, slope, slope)
    light, _ = shown_light(at, film)
    actual = np.stack([cv2.GaussianBlur(plane, (0, 0), 0.8) for plane in light]) - light
    expected = 0.32 * np.stack([cv2.Laplacian(plane, cv2.CV_32F) for plane in light])
    smooth = np.abs(actual) < 0.02
    inside = np.s_[:, 4:-4, 4:-4]
    assert (
        np.corrcoef(actual[inside][smooth[inside]], expected[inside][smooth[inside]])[0, 1] > 0.98
    )


@pytest.mark.parametrize("axis", [1, 2])
def test_a_fold_hides_the_slope_that_its_light_is_a_mixture_for(axis: int) -> None:
    level, wall = np.float32([0, 0]), np.float32([0.4, -0.1])
    dark, bright, one = np.float32([1, 1]), np.float32([0.6, 1.5]), np.ones((1, 4), np.float32)

    def profile(before: F4, on: F4, after: F4) -> F4:
        half = np.repeat(before[:, None], 4, axis=1)
        along = np.concatenate([half, on[:, None], np.repeat(after[:, None], 4, axis=1)], axis=1)
        plane = along[:, None] * one.T
        return plane if axis == 2 else plane.swapaxes(1, 2)

    found = 0.1 * wall
    light = profile(dark, 0.7 * dark + 0.3 * bright, bright)
    hidden, turn = (part.take(4, -(3 - axis)) for part in folds(profile(level, found, wall), light))
    assert hidden == pytest.approx(np.repeat((0.3 * wall - found)[:, None], 4, axis=1), abs=1e-6)
    assert turn == pytest.approx(0.1 * 0.9 * (wall @ wall), rel=1e-5)


def test_smooth_film_hides_nothing() -> None:
    bending = np.linspace(0, 1, 40, dtype=np.float32) ** 2 + np.zeros((2, 30, 1), np.float32)
    hidden, turn = (part[..., 2:-2] for part in folds(bending, 1 + bending))
    assert not hidden.any()
    assert not turn.any()


@pytest.mark.parametrize("blur", [0.51, 0.7, 0.9])
@pytest.mark.parametrize("roundness", [0.0, 0.3, 0.7, 1.5])
def test_a_blurred_fold_mixes_light_as_its_gradients_tell(blur: float, roundness: float) -> None:
    """Both sides of a fold, its light seen through pixels and a blur, twenty times as fine."""
    fine = np.linspace(-12, 12, 480, endpoint=False)
    fold = gaussian_filter1d((fine > 0).astype(float), max(20 * roundness, 1e-6), mode="nearest")

    def seen(light: NDArray[np.float64]) -> NDArray[np.float64]:
        blurred = gaussian_filter1d(light, 20 * blur, mode="nearest")
        return uniform_filter1d(blurred, 20, mode="nearest")

    mixed = (seen(fold * fold) - seen(fold) ** 2).sum() / 20
    gradients = np.square(np.diff(seen(fold)[::20])).sum()
    spread, counts = mixing(1.5, blur)
    assert not counts
    assert 0.6 * mixed < spread * gradients < 1.5 * mixed


def test_a_blur_within_a_pixel_leaves_folds_their_sides() -> None:
    assert mixing(1.5, 0.3) == (pytest.approx(0.09), True)
    assert mixing(1.0, 0.9) == (pytest.approx(0.81), False)


def test_all_behind_a_fold_shares_its_error_under_a_coat() -> None:
    z, slope = (0.08 * part for part in table())
    matt, coated = (stated_error(z, slope, 1e-6, refraction=n)[TOP] for n in (1.0, 1.5))
    assert coated.min() > 10 * matt.max()
    # What noise may have bent is no fold, and the error is that of noise alone.
    some, twice = (stated_error(z, slope, noise, refraction=1.5)[TOP] for noise in (0.1, 0.2))
    assert twice == pytest.approx(2 * some, rel=0.05)


def test_uncertain_leds_are_an_error_where_the_film_is_not_at_rest() -> None:
    z, slope = dome()
    lights = np.concatenate([distant_led(60, azimuth) for azimuth in (0, 90, 180, 270)])
    errors = []
    for share in (0.0, 0.01, 0.02):
        others = exact(lights)
        others[::2, 0, 0] *= 1 + share
        others[1::2, 0, 0] *= 1 - share
        errors.append(stated_error(z, slope, 1e-6, others))
    inside, core = at_rest(z) == 0, far_from_rest(z)
    assert errors[1][core].min() > 10 * errors[0][inside].max()
    assert np.allclose(errors[2][inside], 2 * errors[1][inside], rtol=0.05)
    assert not any(error[~inside].any() for error in errors)


@pytest.mark.parametrize("part", [0, 2, 4])
def test_the_misfit_of_a_film_model_is_an_error_in_proportion(part: int) -> None:
    """The misfit is an angle of normals over a width, a departure of light, or a common tilt."""
    z, slope = dome()
    misfit = np.float32([0, 0.5, 0, 0, 0])
    errors = []
    for level in (0.0, 0.01, 0.02):
        misfit[part] = level
        errors.append(stated_error(z, slope, 1e-6, misfit=misfit))
    none, some, more = errors
    core = far_from_rest(z)
    assert (some[core] > 10 * none[core]).all()
    assert np.allclose(more[core], 2 * some[core], rtol=0.05)


def test_large_errors_of_a_rim_do_not_spread_to_the_film_around_it() -> None:
    variance, free = np.full(SHAPE, 1e-4, np.float32), np.ones(SHAPE, np.float32)
    variance[:, 32:] = 1
    deviation = _smooth_deviation(variance, free) / np.exp(LOG_BIAS / 2)
    assert (deviation[:, 31:33] > 0.05).all()
    assert (deviation[:, 28] < 0.02).all()


def test_the_error_of_eight_draws_is_right_on_average() -> None:
    draws = np.random.default_rng(1).chisquare(8, (300, 300)).astype(np.float32) / 8
    deviation = _smooth_deviation(draws, np.ones_like(draws))
    assert deviation.mean() == pytest.approx(1, abs=0.01)


def bounced_error(**settings: Any) -> F4:
    return stated_error(*dome(), 0.001, **settings)


def thrown(light: float) -> F4:
    """Light that the film throws on the side of one LED."""
    one = np.zeros((4, *SHAPE), np.float32)
    one[0] = light
    return one


def test_the_error_of_bounced_light_is_the_disagreement_of_the_presses() -> None:
    doubt = np.float32([0, 1, 0, 0.3, 0])
    exact_bounce = bounced_error(bounced=thrown(0.2), misfit=0 * doubt)
    assert np.array_equal(bounced_error(bounced=thrown(0.0), misfit=doubt), bounced_error())
    assert bounced_error(bounced=thrown(0.2), misfit=doubt).max() > 1.5 * exact_bounce.max()


def test_bounced_light_that_has_not_settled_is_an_error() -> None:
    """All of it: as much as if the presses disagreed about that share."""
    settled = bounced_error(bounced=thrown(0.2), own_bounce=thrown(0.2))
    assert np.array_equal(settled, bounced_error(bounced=thrown(0.2)))
    unsettled = bounced_error(bounced=thrown(0.2), own_bounce=thrown(0.14))
    doubted = bounced_error(bounced=thrown(0.2), misfit=np.float32([0, 1, 0, 0.3, 0]))
    assert unsettled.max() > 1.5 * settled.max()
    assert unsettled.max() == pytest.approx(doubted.max(), rel=0.05)


def test_the_error_of_film_held_at_zero_is_its_height_by_slopes_alone() -> None:
    rest, error = at_rest(plateau()), np.full(SHAPE, np.float32(0.002))
    flat = np.zeros(SHAPE, np.float32)
    stated = doubt_rest(error, rest, flat + np.float32(0.1), variance_of(1e-4), PIXEL, *3 * [flat])
    assert stated[rest == 1] == pytest.approx(0.1, rel=0.01)
    assert (stated[rest == 0] == error[rest == 0]).all()
    hidden = doubt_rest(error, rest, flat, variance_of(1e-4), PIXEL, *3 * [flat])[rest == 1]
    assert hidden == pytest.approx(4.5 / np.sqrt(3) * 0.01 * PIXEL, rel=1e-4)


def test_the_error_of_film_held_at_zero_is_the_distance_of_its_pieces() -> None:
    rest, error = at_rest(plateau()), np.full(SHAPE, np.float32(0.002))
    flat = np.zeros(SHAPE, np.float32)
    stated = doubt_rest(
        error, rest, flat, variance_of(1e-12), PIXEL, flat - np.float32(0.1), flat, flat
    )
    assert stated == pytest.approx(0.1, rel=1e-3)


def test_the_error_of_a_slope_is_limited_by_the_steepest_slope() -> None:
    flat, rest = np.zeros(SHAPE, np.float32), np.ones(SHAPE, np.uint8)
    stated = doubt_rest(flat, rest, flat, variance_of(1e12), PIXEL, *3 * [flat], level=1.0)
    assert stated == pytest.approx(PIXEL / np.sqrt(3), rel=1e-4)


def table() -> tuple[F4, F4]:
    """A height with a rim all around, and its slopes."""
    z = plateau(1.0)
    return z, np.stack(np.gradient(z, PIXEL)[::-1]).astype(np.float32)


TOP = np.s_[16:24, 24:32]


def test_an_edge_may_lie_anywhere_in_its_pixel() -> None:
    stated = error_of(*table(), 100)
    assert stated[13:27, [19, 20, 34, 35]].min() > 0.8 / np.sqrt(12)
    assert stated[TOP].max() < 0.1


def test_all_that_a_rim_carries_shares_its_error() -> None:
    """No slope on the top of a table errs, but all of it stands on the steps of its rim."""
    z, slope = (0.08 * part for part in table())
    bent, known = (stated_error(z, slope, 1e-6, apparent=k * slope) for k in (0.8, 1))
    assert bent[TOP].min() > 2 * known[TOP].max()
    assert np.ptp(bent[TOP]) < 0.3 * bent[TOP].mean()


def test_shadows_that_disagree_are_an_error_of_all_that_a_rim_carries() -> None:
    z, slope = table()
    pixels = np.arange(z.size, dtype=np.int32).reshape(SHAPE)
    top, foot = (pixels[rows, 20:36].ravel() for rows in ([12, 27], [10, 29]))
    rises = ShadowRises(top, foot, np.ones(32, np.float32), np.ones(32, np.uint8))
    system = equations(slope, 1e-4, at_rest(z), rises)
    longer = system._replace(rise=system.rise + np.float32(0.1))
    agreed, disagreed = (
        stated_error(z, slope, 1e-6, system=each)[TOP] for each in (system, longer)
    )
    assert disagreed.min() > 1.5 * agreed.max()
    diffused = stated_error(z, slope, 1e-6, system=longer, diffuse=0.4)[TOP]
    assert diffused.max() < 1.1 * agreed.max()


def test_noise_changes_the_height_by_the_stated_error() -> None:
    z, slope = dome()
    inside = at_rest(z) == 0
    stated = error_of(z, slope, 1)
    sd = 0.01 / (np.sqrt(2) * np.cos(np.radians(60)) / np.sin(np.radians(60)))
    rng = np.random.default_rng(7)
    errors = [
        integrate_weighted(equations(slope + noise, 1e-4, at_rest(z), bend=0.0, robust=1e6), z) - z
        for noise in rng.normal(0, sd, (12, *slope.shape)).astype(np.float32)
    ]
    ratio = np.sqrt(np.mean(np.square(errors), axis=0)[inside]).mean() / stated[inside].mean()
    assert ratio == pytest.approx(1, abs=0.3)


def test_an_uncertain_scale_is_an_error_of_every_height() -> None:
    z, _ = dome()
    rest, flat, error = at_rest(z), np.zeros(SHAPE, np.float32), np.full(SHAPE, np.float32(0.001))
    inputs = error, rest, flat, variance_of(1e-12), PIXEL, flat, z, flat
    sure, unsure = (doubt_rest(*inputs, scale_error=share) for share in (0, 0.2))
    assert np.allclose(unsure[rest == 0], np.hypot(sure, 0.2 * z)[rest == 0], rtol=1e-5)
    assert np.array_equal(unsure[rest == 1], sure[rest == 1])
    assert unsure.max() > 2 * sure.max()


def test_the_error_of_a_skirt_is_one_of_all_that_stands_on_it() -> None:
    rest, error = at_rest(plateau()), np.full(SHAPE, np.float32(0.03))
    flat = np.zeros(SHAPE, np.float32)
    skirt = flat + np.float32(0.04)
    stated = doubt_rest(error, rest, flat, variance_of(1e-12), PIXEL, flat, flat, skirt)
    assert stated[rest == 0] == pytest.approx(0.05)
    assert stated[rest == 1] == pytest.approx(0.04, rel=1e-3)


def test_an_unknown_zero_is_an_error_everywhere() -> None:
    rest, error = at_rest(plateau()), np.full(SHAPE, np.float32(0.03))
    flat = np.zeros(SHAPE, np.float32)
    stated = doubt_rest(error, rest, flat, variance_of(1e-12), PIXEL, *3 * [flat], zero=0.04)
    assert stated[rest == 0] == pytest.approx(0.05)
    assert stated[rest == 1] == pytest.approx(0.04, rel=1e-3)
