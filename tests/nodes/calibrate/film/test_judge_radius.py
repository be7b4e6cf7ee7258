"""The light distinguishes a wrong radius of the ball from the right one."""

import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tactograph.nodes import Film
from tactograph.nodes.calibrate.ball.balls_on_film import Balls
from tactograph.nodes.calibrate.film.ball_samples import FilmEvidence
from tactograph.nodes.calibrate.film.judge_radius import (
    AS_STATED,
    CLEAR_GEL,
    OTHER_CAMERA,
    OTHER_POWER,
    OTHER_SIZE,
    Alternatives,
    Explained,
)
from tactograph.nodes.capture.read_capture import read_capture
from tests.fixtures import RIG_PIXEL_MM, Raytraced

BALL = 7.0
"""Radius of the rigs' balls in mm."""
NOISE = np.array([1e-4, 1e-6], np.float32)
DISTANT = np.array([[1, 1, 2], [-1, 1, 2], [-1, -1, 2], [1, -1, 2]], np.float32) * 100


def image_of(folder: Path) -> np.ndarray:
    (capture,) = read_capture(folder=folder)
    return capture.image


def sampled(rig: Path, factor: float, gamma: float = 1.0) -> tuple[FilmEvidence, Balls]:
    """A rig's ball of a radius that is wrong by a factor, and samples of it."""
    flat, pixel, radius = image_of(rig / "flat"), RIG_PIXEL_MM[rig.name], BALL * factor
    flat = flat ** np.float32(1 / gamma)
    light = image_of(rig / "calibration") ** np.float32(1 / gamma) / flat
    centre = json.loads((rig / "calibration" / "scene.json").read_text())["sphere_center_px"]
    circle = np.array([[*centre, 0.95 * min(radius, BALL) / pixel]], np.float32)
    one = np.array([radius], np.float32)
    first, placed = np.zeros(1, np.int32), (np.ones(1, np.uint8), DISTANT, np.ones(4, np.float32))
    evidence = FilmEvidence(light, flat, circle, one, first, *placed, NOISE, pixel)
    return evidence, evidence.sample(Film.matt(DISTANT), most=None, fine=True)


@cache
def alternatives(rig: Path, factor: float, gamma: float = 1.0) -> Alternatives:
    """The alternatives that the light of a rig's ball allows to a radius wrong by a factor."""
    return Alternatives.of(*sampled(rig, factor, gamma))


@pytest.mark.one_case
@pytest.mark.parametrize("rig", ["far28", "near33"])
def test_a_right_radius_is_confirmed(raytraced: Raytraced, rig: str) -> None:
    light = alternatives(raytraced / rig, 1.0)
    assert light.doubts(BALL) == ([], False)
    assert not light.unconfirmed(BALL)
    assert light.scale_error() == 0


@pytest.mark.one_case
@pytest.mark.parametrize(
    ("rig", "factor"), [("near33", 0.9), ("near33", 1.03), ("near33", 2), ("far28", 1.1)]
)
def test_a_wrong_radius_is_refused_and_the_right_one_named(
    raytraced: Raytraced, rig: str, factor: float
) -> None:
    light = alternatives(raytraced / rig, factor)
    (doubt,), is_clear = light.doubts(BALL * factor)
    assert is_clear
    assert factor * light.by_name[OTHER_SIZE].size == pytest.approx(1, rel=0.02)
    assert f"a ball of {BALL * factor * light.by_name[OTHER_SIZE].size:.3g} mm radius" in doubt
    assert ("its diameter" in doubt) == (factor == 2)
    assert ("given too large" in doubt) == (1 < factor < 2)
    assert ("pixel size too large" in doubt) == (factor < 1)
    assert light.scale_error() > abs(factor - 1) / 2


@pytest.mark.one_case
@pytest.mark.parametrize(("rig", "gamma"), [("near33", 1.15), ("near33", 1.0), ("far28", 1.15)])
def test_a_gamma_of_the_camera_is_reported(raytraced: Raytraced, rig: str, gamma: float) -> None:
    doubts, _ = alternatives(raytraced / rig, 1.0, gamma).doubts(BALL)
    assert ["switch its gamma" in doubt for doubt in doubts] == [True] * (gamma > 1)


def unexplained(**departures: float) -> Alternatives:
    """Alternatives with stated shares of unexplained light."""
    plain = Explained(1.0, 1.0, 0.0, 0.03, 50.0, 0.0)
    explained = {
        OTHER_SIZE: plain._replace(size=0.5, diffuse=0.4),
        CLEAR_GEL: plain._replace(size=0.6),
        OTHER_POWER: plain._replace(power=1 / 2.2),
        OTHER_CAMERA: plain._replace(camera=1 / 60),
        AS_STATED: plain,
    }
    some = {name: explained[name]._replace(departure=share) for name, share in departures.items()}
    return Alternatives(explained | some, 80, {OTHER_SIZE: 0.4, CLEAR_GEL: 0.5})


def test_the_likeliest_value_is_named_with_all_that_explain_as_much() -> None:
    (doubt,), is_clear = unexplained(camera=0.02, size=0.0201).doubts(6.0)
    assert doubt.startswith("a camera 60 mm above the film explains the light better")
    assert "so does a ball of 3 mm radius" in doubt
    assert "`film.camera`=MM" in doubt
    assert is_clear
    (doubt,), _ = unexplained(camera=0.02, size=0.027).doubts(6.0)
    assert "ball" not in doubt


def test_light_that_the_chosen_film_explains_better_is_no_evidence() -> None:
    assert unexplained(size=0.02).doubts(6.0, misfit=0.011) == ([], False)


def test_a_chosen_film_that_explains_less_than_a_plain_one_is_doubted() -> None:
    (doubt,), is_clear = unexplained().doubts(6.0, misfit=0.26)
    assert "the best leaves 26.0% of the light unexplained" in doubt
    assert "a near camera (`film.camera`=MM), and a lens" in doubt
    assert not is_clear


def test_a_radius_is_open_until_the_light_excludes_a_gel_that_diffuses_none() -> None:
    light = unexplained(stated=0.03, clear=0.031)
    assert "radius: 6 mm fits, and so does 3.6 mm. Heights" in light.unconfirmed(6.0)
    light.by_name[AS_STATED] = light.stated._replace(diffuse=0.1)
    unconfirmed = light.unconfirmed(6.0)
    assert "6 mm fits if the gel diffuses 10% of the light, and so does 3.6 mm if" in unconfirmed
    # A ball of 0.6 times the radius is half as high; pixels of 1 / 0.6 times the size add that.
    assert light.scale_error() == pytest.approx(math.hypot(0.5, 1 - 0.5 / 0.6) / math.sqrt(2))
    excluded = unexplained(stated=0.03, clear=0.04)
    assert not excluded.unconfirmed(6.0)
    assert excluded.scale_error() == 0


def test_an_open_radius_is_settled_by_what_excludes_the_other() -> None:
    """A ruler does if it agrees with one of the two radii alone."""
    light = unexplained(stated=0.03, clear=0.031)
    assert "a deeper press, with the ball's shadow" in light.unconfirmed(6.0, ruler="`mm`")
    assert "`mm`" not in light.unconfirmed(6.0, ruler="`mm`"), "both have the LEDs in one place"
    light.by_name[CLEAR_GEL] = light.by_name[CLEAR_GEL]._replace(distance=60.0)
    assert "film's middle, 50 or 60 mm (`mm`=MM)" in light.unconfirmed(6.0, ruler="`mm`")
    right, wrong = light._replace(ruler_mm=51.0), light._replace(ruler_mm=59.0)
    assert not right.unconfirmed(6.0)
    assert right.scale_error() == 0
    assert wrong.scale_error() == light.scale_error() > 0
