"""Parts of a frame without light are no film."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4
from tactograph.nodes.calibrate.rest.find_film import find_film
from tactograph.nodes.light.within_film import within_film

ROWS, COLUMNS = np.mgrid[:90, :120].astype(np.float32)
ROUND = np.hypot(COLUMNS - 59.5, ROWS - 44.5) < 40


def lit(visible: NDArray[np.bool_]) -> F4:
    """Film under four LEDs that fall off across it, and housing with hardly any light."""
    away = [np.hypot(COLUMNS - x, ROWS - y) for x, y in ((0, 0), (119, 0), (119, 89), (0, 89))]
    film = np.stack([0.6 * np.exp(-((d / 130) ** 2)) for d in away])
    return np.where(visible, film, 0.008).astype(np.float32)


def test_film_that_fills_the_frame_is_not_changed() -> None:
    flat = lit(np.ones((90, 120), bool))
    film = find_film(flat)
    assert film.area.all()
    assert film.flat is flat
    assert within_film(flat, film.area, flat, 0 * flat[0]) is flat


def test_a_round_view_is_found_without_its_rim_and_its_light_is_continued() -> None:
    with collect_warnings([]) as notes:
        film = find_film(lit(ROUND), warning=True)
    assert not (film.area[~ROUND]).any()
    assert film.area[np.hypot(COLUMNS - 59.5, ROWS - 44.5) < 30].all()
    full = lit(np.ones((90, 120), bool))
    near = np.hypot(COLUMNS - 59.5, ROWS - 44.5) < 50
    np.testing.assert_allclose(film.flat[:, near], full[:, near], rtol=0.05)
    assert len(notes) == 1
    assert "fills" in notes[0]
    assert "a crop" in notes[0]


@pytest.mark.parametrize("what", ["a marker inside", "markers at the border", "vignetting"])
def test_dark_film_is_film(what: str) -> None:
    flat = lit(np.ones((90, 120), bool))
    if what == "a marker inside":
        flat[:, 30:50, 40:60] = 0.01
    elif what == "markers at the border":
        flat[:, 20:28, :6] = flat[:, 60:68, -6:] = 0.01
    else:
        flat *= 1 - 0.85 * (np.hypot(COLUMNS - 59.5, ROWS - 44.5) / 75) ** 2
    assert find_film(flat).area.all()


def test_a_touch_looks_like_film_at_rest_where_there_is_no_film() -> None:
    flat, dark = lit(ROUND), np.full((90, 120), 0.01, np.float32)
    film = find_film(flat)
    image = np.full_like(flat, 0.3)
    shown = within_film(image, film.area, film.flat, dark)
    assert (shown[:, film.area == 1] == 0.3).all()
    assert np.allclose((shown - dark)[:, film.area == 0], film.flat[:, film.area == 0])
