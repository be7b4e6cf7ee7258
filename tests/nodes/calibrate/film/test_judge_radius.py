"""A wrong radius of the ball is told from the right one by the light."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.calibrate.colour.level_presses import level_presses
from tactograph.nodes.calibrate.film._ball_samples import sample_balls
from tactograph.nodes.calibrate.film.balls_on_film import Balls
from tactograph.nodes.calibrate.film.judge_press_radius import judge_press_radius
from tactograph.nodes.calibrate.film.judge_radius import (
    Doubt,
    Tried,
    doubt_of_diffuse,
    doubt_of_pattern,
    doubt_of_radius,
    try_gammas,
    try_radii,
)
from tactograph.nodes.capture.read_capture import read_capture
from tactograph.nodes.capture.read_presses import read_presses
from tactograph.nodes.optics.film import matt_film
from tests.fixtures import RIG_PIXEL_MM, Raytraced, real_data

BALL = 7.0
"""Radius of the rigs' balls in mm."""
NOISE = np.array([1e-4, 1e-6], np.float32)
DISTANT = np.array([[1, 1, 2], [-1, 1, 2], [-1, -1, 2], [1, -1, 2]], np.float32) * 100


def image_of(folder: Path) -> np.ndarray:
    (capture,) = read_capture(folder=folder)
    return capture.image


def sampled(rig: Path, factor: float, gamma: float = 1.0) -> tuple[Balls, F4, float]:
    """A rig's ball of a radius that is wrong by a factor, its flat frame, and a pixel in mm."""
    flat, pixel, radius = image_of(rig / "flat"), RIG_PIXEL_MM[rig.name], BALL * factor
    flat = flat ** np.float32(1 / gamma)
    light = image_of(rig / "calibration") ** np.float32(1 / gamma) / flat
    centre = json.loads((rig / "calibration" / "scene.json").read_text())["sphere_center_px"]
    circle = np.array([[*centre, 0.95 * min(radius, BALL) / pixel]], np.float32)
    one = np.array([radius], np.float32)
    balls = sample_balls(
        light, flat, circle, one, np.zeros(1, np.int32), matt_film(DISTANT), NOISE, pixel,
        most=None, fine=True,
    )  # fmt: skip
    return balls, flat, pixel


def tried(rig: Path, factor: float, gamma: float = 1.0) -> list[Tried]:
    """What the light of a rig's ball says of radii."""
    return try_radii(*sampled(rig, factor, gamma), DISTANT, np.ones(4, np.float32))


@pytest.mark.one_case
@pytest.mark.parametrize("rig", ["far28", "near33"])
def test_a_right_radius_raises_no_doubt(raytraced: Raytraced, rig: str) -> None:
    assert doubt_of_radius(tried(raytraced / rig, 1.0), BALL) == Doubt("", False)


@pytest.mark.one_case
@pytest.mark.parametrize(
    ("rig", "factor"), [("near33", 0.9), ("near33", 1.03), ("near33", 2), ("far28", 1.1)]
)
def test_a_wrong_radius_is_refused_and_the_right_one_named(
    raytraced: Raytraced, rig: str, factor: float
) -> None:
    found = tried(raytraced / rig, factor)
    doubt = doubt_of_radius(found, BALL * factor)
    best = min(found, key=lambda each: each.departure)
    assert doubt.is_clear
    assert BALL * factor * best.factor == pytest.approx(BALL, rel=0.02)
    assert f"a ball of {BALL * factor * best.factor:.3g} mm radius" in doubt.sentence
    assert ("its diameter" in doubt.sentence) == (factor == 2)
    assert ("given too large" in doubt.sentence) == (1 < factor < 2)
    assert ("pixel size too large" in doubt.sentence) == (factor < 1)


@pytest.mark.one_case
@pytest.mark.parametrize(("factor", "is_noise"), [(1.0, True), (1.03, False)])
def test_far_radii_are_tried_only_where_the_given_one_leaves_more_than_noise(
    raytraced: Raytraced, factor: float, is_noise: bool
) -> None:
    light = sampled(raytraced / "near33", factor)
    found = try_radii(*light, DISTANT, np.ones(4, np.float32), left=0.01)
    assert all(each.factor <= 1 for each in found) == is_noise
    assert (doubt_of_radius(found, BALL * factor, 0.01).sentence == "") == is_noise


@pytest.mark.one_case
@pytest.mark.parametrize(
    ("rig", "gamma", "told"),
    [("near33", 1.15, True), ("near33", 1.0, False), ("far28", 1.15, True)],
)
def test_a_gamma_of_the_camera_is_told(
    raytraced: Raytraced, rig: str, gamma: float, told: bool
) -> None:
    powers = try_gammas(*sampled(raytraced / rig, 1.0, gamma), DISTANT, np.ones(4, np.float32))
    doubts = doubt_of_pattern(tried(raytraced / rig, 1.0, gamma), powers, BALL)
    assert ["raised to the power of 1.15" in doubt for doubt in doubts] == [True] * told


@pytest.mark.parametrize(
    ("diffuse", "darkest", "told"),
    [
        (0.18, 0.25, True),  # Nowhere as dark as the gel's light: no shadow measures it.
        (0.18, 0.18, False),  # A shadow, as bright as the gel's light.
        (0.0, 0.25, False),
        (0.4, 0.42, False),  # As real gels have it.
        (0.4, 0.3, True),  # No film is darker than what the gel diffuses.
    ],
)
def test_diffuse_light_that_no_shadow_confirms_may_be_a_wrong_radius(
    diffuse: float, darkest: float, told: bool
) -> None:
    light = np.concatenate([np.full(100, darkest), np.linspace(0.45, 1.2, 900)])[None]
    doubts = doubt_of_diffuse(diffuse, light, 4.0)
    assert ["does not confirm" in doubt for doubt in doubts] == [True] * told


def plain(factor: float, departure: float, diffuse: float = 0.0) -> Tried:
    return Tried(factor, departure, departure, 50.0, diffuse)


def test_a_film_chosen_that_explains_less_than_a_plain_one_is_doubted() -> None:
    doubt = doubt_of_radius([plain(1.0, 0.03), plain(1.07, 0.027)], 6.0, left=0.26)
    assert "the best leaves 26.0% of the light unexplained" in doubt.sentence
    assert not doubt.is_clear


def test_a_film_chosen_that_explains_more_than_any_plain_one_is_not() -> None:
    assert not doubt_of_radius([plain(1.0, 0.06), plain(0.97, 0.03)], 6.0, left=0.011).sentence


def test_light_that_fits_two_radii_alike_doubts_the_one_without_diffuse_light() -> None:
    alike = [plain(0.5, 0.066, 0.44), plain(1.0, 0.072, 0.0)]
    assert "the gel would diffuse no light" in doubt_of_radius(alike, 6.31).sentence
    apart = [plain(0.5, 0.2, 0.44), plain(1.0, 0.072, 0.0)]
    assert not doubt_of_radius(apart, 6.31).sentence


@cache
def mini() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Some presses of the GelSight Mini, its film at rest, and their circles."""
    data = real_data("gelsight_mini_balls")
    film = read_presses(folder=data / "6.310mm", flat=data / "background.png")
    labels = np.genfromtxt(data / "labels.csv", delimiter=",", skip_header=1, usecols=(2, 3, 4))
    numbers = np.array([int(name) for name in film.names])
    inside = (np.abs(labels[:, 0] - 160) < 130) & (np.abs(labels[:, 1] - 120) < 90)
    some = np.flatnonzero(inside[numbers])[::2]
    return level_presses(film.image[some], film.flat), film.flat, labels[numbers[some]]


@pytest.mark.one_case
@pytest.mark.parametrize(("radius", "doubtful"), [(3.155, False), (6.31, True)])
def test_a_diameter_typed_as_radius_is_told_on_a_real_one_shot_sensor(
    radius: float, doubtful: bool
) -> None:
    image, flat, circle = mini()
    kept = np.ones(len(image), np.uint8)
    verdict = judge_press_radius(
        image, flat, circle.astype(np.float32), kept, 0.0634, radius_mm=radius
    )
    assert bool(verdict.doubts) == doubtful
    assert all("may be the ball's diameter" in doubt for doubt in verdict.doubts)
