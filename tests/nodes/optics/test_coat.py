"""A rough coat behaves as its microfacets on average."""

import numpy as np
import pytest

from tactograph.nodes.optics.coat import beckmann, fresnel, let_in, masking

RNG = np.random.default_rng(2)


@pytest.mark.parametrize("index", [1.2, 1.5, 2.0])
def test_a_dielectric_mirrors_as_fresnel_states(index: float) -> None:
    assert fresnel(np.array(1.0), index) == pytest.approx(((index - 1) / (index + 1)) ** 2)
    assert fresnel(np.array(0.0), index) == pytest.approx(1)
    cosines = np.linspace(0, 1, 50)
    assert (np.diff(fresnel(cosines, index)) < 0).all()


@pytest.mark.parametrize("roughness", [0.1, 0.2, 0.4])
@pytest.mark.parametrize("index", [1.3, 1.6])
def test_a_rough_coat_lets_in_its_microfacets_average(roughness: float, index: float) -> None:
    """Facets of Beckmann's distribution, weighted by their size as seen by light."""
    x, y = RNG.normal(0, roughness / np.sqrt(2), (2, 1_000_000))
    for cosine in (0.05, 0.1, 0.2, 0.4, 0.7, 1.0):
        projected = np.maximum(cosine - np.sqrt(1 - cosine**2) * x, 0)
        through = 1 - fresnel(np.minimum(projected / np.sqrt(1 + x * x + y * y), 1), index)
        mean = (projected * through).sum() / projected.sum()
        steeply = 0.003 if roughness == 0.4 else 0.001
        within = 0.006 if cosine < 0.2 else steeply
        assert let_in(np.array(cosine), roughness, index) == pytest.approx(mean, abs=within)
    head_on = 1 - fresnel(np.array(1.0), index)
    assert let_in(np.array(1.0), roughness, index) == pytest.approx(head_on, abs=1e-3)


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.5])
def test_microfacets_cover_the_film_once(roughness: float) -> None:
    cosine = np.linspace(1e-3, 1, 200001)
    density = beckmann(cosine, roughness) * cosine * 2 * np.pi
    assert np.trapezoid(density, cosine) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.5])
def test_microfacets_hide_one_another_at_grazing_angles_only(roughness: float) -> None:
    share = masking(np.linspace(0.01, 1, 100), roughness)
    assert (share >= 0).all()
    assert share.max() == pytest.approx(1, abs=1e-3)
    assert share[0] < 0.4 < share[-1]
