"""Waves of known length behind the filters of ISO 25178-3."""

import json
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes import F4
from tactograph.rings.export.nodes.export_height import export_height
from tactograph.rings.export.nodes.read_pixel_size import read_pixel_size
from tactograph.rings.metrology.nodes.filled.level_plane import level_plane
from tactograph.rings.metrology.nodes.surface.filter_surface import filter_surface, form

PIXEL = 0.01


def wave(length_mm: float, height: float = 1.0) -> F4:
    x = PIXEL * np.arange(400)
    return np.tile(np.float32(height * np.sin(2 * np.pi * x / length_mm)), (300, 1))


def amplitude(z: F4) -> float:
    """Of a wave in the middle of the map, where no border reaches."""
    return float(np.sqrt(2) * z[100:200, 100:300].std())


@pytest.mark.parametrize(
    ("length", "by", "left"), [(0.5, "s", 0.5), (0.5, "l", 0.5), (0.1, "s", 0), (0.1, "l", 1)]
)
def test_half_of_a_wave_as_long_as_the_nesting_index_passes(
    length: float, by: str, left: float
) -> None:
    filtered = filter_surface(wave(length), PIXEL, **{f"{by}_filter_mm": 0.5}).height
    assert amplitude(filtered) == pytest.approx(left, abs=0.01)


def test_the_nesting_indices_stand_in_the_result(tmp_path: Path) -> None:
    found = filter_surface(wave(0.5), PIXEL, s_filter_mm=0.1, l_filter_mm=2.0)
    metrics = found.metrics
    export_height(found.height, PIXEL, metrics=metrics, folder=tmp_path, formats=("npy",))
    record = json.loads((tmp_path / "result.json").read_text())
    assert record["metrics"] == {"form_degree": 1, "s_filter_mm": 0.1, "l_filter_mm": 2}
    assert read_pixel_size(height=tmp_path / "height.npy") == PIXEL


def test_a_ball_is_a_form_of_degree_two() -> None:
    y, x = np.mgrid[-1:1:100j, -1:1:120j]
    z = (-0.3 * x * x - 0.3 * y * y + 0.1 * x).astype(np.float32)
    assert np.abs(z - form(z, 2)).max() < 1e-5
    assert np.abs(z - form(z, 1)).max() > 0.1


def test_unknown_film_stays_unknown_and_spoils_nothing() -> None:
    z = wave(1.0)
    z[150, 200] = np.nan
    filtered = filter_surface(z, PIXEL, form_degree=0, s_filter_mm=0.1).height
    assert np.isnan(filtered).sum() == 1
    assert amplitude(np.nan_to_num(filtered)) == pytest.approx(1, abs=0.02)


def test_exchanged_nesting_indices_are_refused() -> None:
    with pytest.raises(InputError, match="give the smaller as `s_filter_mm`"):
        filter_surface(wave(1.0), PIXEL, s_filter_mm=0.8, l_filter_mm=0.1)


def test_a_plane_is_fitted_despite_objects_on_it() -> None:
    y, x = np.mgrid[:120, :160]
    z = (0.002 * x - 0.001 * y + 0.3).astype(np.float32)
    pressed = z + np.where((x - 80) ** 2 + (y - 60) ** 2 < 30**2, 0.4, 0).astype(np.float32)
    level = level_plane(pressed)
    assert np.abs(level[pressed == z]).max() < 5e-4
    assert level.max() == pytest.approx(0.4, abs=1e-3)
