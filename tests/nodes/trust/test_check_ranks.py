"""How rare the figures of a touch are among those of valid ones."""

import numpy as np
import pytest

from tactograph.nodes import F8
from tactograph.nodes.trust.check_ranks import (
    CHECK_FIGURES,
    SHADOW_FIGURE,
    of_all_checks,
    p_values,
    ranked,
)

COUNT = len(CHECK_FIGURES)


def trusts(drawn: F8, touches: F8) -> F8:
    known = ranked(drawn)
    return np.array([of_all_checks(p_values(each, known[:-1]).min(), known) for each in touches])


def correlated(rng: np.random.Generator, count: int) -> F8:
    """Figures that depend on one another, as those of a touch do."""
    alike = rng.normal(size=(count, 1))
    return np.abs(rng.normal(size=(count, COUNT)) + np.linspace(0, 2, COUNT) * alike) * 10


@pytest.mark.parametrize("share", [0.3, 0.1, 0.01])
def test_valid_touches_are_doubted_as_often_as_stated(share: float) -> None:
    """This holds for any dependence between the checks."""
    rng = np.random.default_rng(3)
    shares = [
        (trusts(correlated(rng, 128), correlated(rng, 1000)) < share).mean() for _ in range(8)
    ]
    assert 0.5 * share < np.mean(shares) < 2 * share


def test_a_figure_beyond_all_valid_touches_is_rarer_the_larger_it_is() -> None:
    known = ranked(correlated(np.random.default_rng(4), 128))
    figures = np.median(known[:-1], axis=1)
    for place in range(COUNT):
        rarer = [p_values(figures + far * 10 * np.eye(COUNT)[place], known[:-1]) for far in (4, 8)]
        assert rarer[1][place] < rarer[0][place] < 0.2


def test_a_figure_that_no_valid_touch_has_is_known_to_its_resolution() -> None:
    known = ranked(np.zeros((128, COUNT)))
    half = np.array([figure.resolution for figure in CHECK_FIGURES.values()]) / 2
    assert (p_values(half, known[:-1]) > 0.1).all()
    assert (p_values(20 * half, known[:-1]) < 1e-4).all()


def test_presses_that_depart_more_than_the_model_set_the_scale() -> None:
    """Touches like the sensor's own presses are not doubted; those that depart far more are."""
    rng = np.random.default_rng(5)
    drawn = correlated(rng, 128)
    press = np.median(drawn, axis=0)
    press[0] = 3 * drawn[:, 0].max()
    known = ranked(drawn, press[None])
    least = [p_values(press * step, known[:-1]).min() for step in (1.0, 1.2, 10.0)]
    trust = [of_all_checks(each, known) for each in least]
    assert trust[0] > trust[1] > 0.01
    assert trust[2] < 1e-4
    assert of_all_checks(p_values(press, ranked(drawn)[:-1]).min(), ranked(drawn)) < 0.01


def test_a_press_where_the_tail_begins_makes_nothing_beyond_it_rarer() -> None:
    drawn = correlated(np.random.default_rng(7), 128)
    press = np.quantile(drawn, 0.9, axis=0)
    alone, with_press = ranked(drawn)[:-1], ranked(drawn, press[None])[:-1]
    for farther in (1.0, 1.5, 2.0):
        assert (p_values(farther * press, with_press) > p_values(farther * press, alone)).all()


def test_light_in_shadow_is_judged_by_the_touches_that_have_shadows() -> None:
    """Of 117 soft touches 16 had some, so that 0.8 % of light in the shadows of a ball was doubted,
    where walls of the same sensor leave up to 3 %."""
    drawn = correlated(np.random.default_rng(8), 128)
    drawn[:, SHADOW_FIGURE] = 0
    figures, rows = np.median(drawn, axis=0), [ranked(drawn)[:-1]]
    figures[SHADOW_FIGURE] = 0.01
    walls = drawn.copy()
    walls[:50, SHADOW_FIGURE] = np.random.default_rng(9).uniform(-0.01, 0.03, 50)
    rows.append(ranked(drawn, others=walls)[:-1])
    alone, with_walls = (p_values(figures, row)[SHADOW_FIGURE] for row in rows)
    assert alone < 0.01
    assert with_walls > 0.2
    figures[SHADOW_FIGURE] = 0.2
    assert p_values(figures, rows[1])[SHADOW_FIGURE] < 1e-6


def test_presses_like_drawn_touches_make_no_doubt_rarer() -> None:
    rng = np.random.default_rng(6)
    drawn, touches = correlated(rng, 128), correlated(rng, 400)
    alone, with_press = ranked(drawn), ranked(drawn, np.median(drawn, axis=0)[None])
    for known in (alone, with_press):
        trust = [of_all_checks(p_values(each, known[:-1]).min(), known) for each in touches]
        assert np.mean(np.array(trust) < 0.05) < 0.12
    np.testing.assert_allclose(alone[:-1, -20:], with_press[:-1, -20:], rtol=1e-12)
