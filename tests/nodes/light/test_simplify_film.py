"""A film without one of its parts keeps all others."""

import numpy as np
import pytest

from tactograph.nodes import Film
from tactograph.nodes.light.simplify_film import PART_FIELDS, simplify_film
from tests.nodes.films import FILMS

FILM = FILMS["all"]._replace(albedo=0.6, grain=0.01)


@pytest.mark.parametrize("part", PART_FIELDS)
def test_a_part_that_is_switched_off_is_that_of_a_matt_film(part: str) -> None:
    found, matt = simplify_film(FILM, without=(part,)), Film.matt(FILM.lights)
    for name, value in found._asdict().items():
        kept = matt if name in PART_FIELDS[part] else FILM
        assert np.array_equal(value, getattr(kept, name)), name


def test_without_all_parts_it_is_matt_and_with_all_it_stays() -> None:
    assert simplify_film(FILM) == FILM
    found = simplify_film(FILM, without=tuple(PART_FIELDS))
    assert not found.diffuse.any()
    assert not found.harmonics.any()
    assert (found.gain, found.refraction, found.albedo, found.camera) == (1, 1, 0, 0)
