"""Surface parameters of surfaces whose parameters one can work out."""

import sys
from pathlib import Path

import numpy as np
import pytest

from rings.export.tests.test_export_height import partly_known
from rings.export.tests.test_read_pixel_size import stored
from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes import F4
from tactograph.rings.export.nodes.export_height import export_height
from tactograph.rings.metrology.nodes.surface.surface_texture import surface_texture
from tests.nodes.contact.test_largest_contacts import CONTACT, HEIGHT, MAX_MEASURED

PIXEL_MM = 0.05
ROWS, COLUMNS = 120, 160
Y, X = np.indices((ROWS, COLUMNS)) * PIXEL_MM
AMPLITUDE_UM = 20.0
WAVE_MM = 0.8
"""A tenth of the width, so that the surface holds whole waves."""
MIDDLE_MM = (COLUMNS - 1) / 2 * PIXEL_MM
WAVES: F4 = (1e-3 * AMPLITUDE_UM * np.cos(2 * np.pi * (X - MIDDLE_MM) / WAVE_MM)).astype(np.float32)
"""Even about the middle: no plane has a part in it."""


def check_waves(found: dict[str, float], name: str = "") -> None:
    """A sine's parameters: 2 A / pi, A / sqrt(2), 2 A, 0, 3 / 2."""
    assert found[f"Sa_um{name}"] == pytest.approx(2 * AMPLITUDE_UM / np.pi, rel=0.02)
    assert found[f"Sq_um{name}"] == pytest.approx(AMPLITUDE_UM / np.sqrt(2), rel=0.02)
    assert found[f"Sz_um{name}"] == pytest.approx(2 * AMPLITUDE_UM, rel=0.05)
    assert found[f"Ssk{name}"] == pytest.approx(0, abs=0.02)
    assert found[f"Sku{name}"] == pytest.approx(1.5, rel=0.02)


def test_a_sine_has_a_sines_parameters_whatever_plane_it_lies_on() -> None:
    tilted = (WAVES + 0.02 * X - 0.05 * Y + 0.3).astype(np.float32)
    found = surface_texture(tilted, PIXEL_MM)
    check_waves(found)
    assert found["texture_area_mm2"] == pytest.approx(ROWS * COLUMNS * PIXEL_MM**2)


def test_the_form_that_is_taken_off_is_of_the_degree_asked_for() -> None:
    tilted = (WAVES + 0.05 * Y).astype(np.float32)
    assert surface_texture(tilted, PIXEL_MM, form_degree=0)["Sa_um"] > 3 * AMPLITUDE_UM
    ball = (WAVES - ((X - 4) ** 2 + (Y - 3) ** 2) / 40).astype(np.float32)
    check_waves(surface_texture(ball, PIXEL_MM, form_degree=2))
    assert surface_texture(WAVES, PIXEL_MM, np.zeros((ROWS, COLUMNS), np.uint8)) == {}


def test_unknown_pixels_are_left_out_and_not_filled() -> None:
    height = (WAVES + 0.05 * Y).astype(np.float32)
    height[:, :16] = np.nan  # one wave
    height[40:50, 60:90] = np.nan
    found = surface_texture(height, PIXEL_MM)
    check_waves(found)
    assert found["texture_area_mm2"] == pytest.approx(
        np.isfinite(height).sum() * PIXEL_MM**2, rel=1e-6
    )


def test_every_contact_has_its_own_texture_without_its_border() -> None:
    height, contact = np.zeros((ROWS, COLUMNS), np.float32), np.zeros((ROWS, COLUMNS), np.uint8)
    # Where the film climbs to the object it is no texture.
    height[4:64, 8:152], contact[4:64, 8:152] = 0.2, 1
    height[8:60, 12:148] = 0.5 + WAVES[8:60, 12:148]
    height[80:110, 20:60], contact[80:110, 20:60] = 0.4, 2
    found = surface_texture(height, PIXEL_MM, contact, edge_px=5)
    assert found["Sq_um/c1"] == pytest.approx(AMPLITUDE_UM / np.sqrt(2), rel=0.05)
    assert found["Sz_um/c1"] == pytest.approx(2 * AMPLITUDE_UM, rel=0.06)
    assert found["Sa_um/c2"] == pytest.approx(0, abs=1e-3)
    assert "Ssk/c2" not in found
    assert found["texture_area_mm2/c2"] == pytest.approx(20 * 30 * PIXEL_MM**2)


@pytest.mark.parametrize("size", [(2, 3), (2, 100), (100, 1)])
def test_too_few_points_have_no_figures_and_a_warning(size: tuple[int, int]) -> None:
    contact = np.zeros((ROWS, COLUMNS), np.uint8)
    contact[: size[0], : size[1]] = 1
    with collect_warnings([]) as notes:
        found = surface_texture(WAVES, PIXEL_MM, contact, edge_px=0)
    assert set(found) == {"texture_area_mm2/c1"}
    assert "too few" in notes[0]


def test_only_the_largest_contacts_have_figures() -> None:
    figures = surface_texture(HEIGHT, 0.1, CONTACT)
    assert len({name.rpartition("/")[2] for name in figures}) == MAX_MEASURED


def test_without_its_package_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "surfalize", None)
    with pytest.raises(InputError, match=r"needs surfalize: pip install 'tactograph\[metrology\]'"):
        surface_texture(WAVES, PIXEL_MM)
    with pytest.raises(InputError, match=r"needs surfalize: pip install 'tactograph\[metrology\]'"):
        export_height(WAVES, PIXEL_MM, folder=Path(), formats=("sur",))


def test_a_height_unknown_in_parts_has_a_texture(tmp_path: Path) -> None:
    np.save(tmp_path / "height.npy", partly_known())
    arguments = {"height": tmp_path / "height.npy", "pixel_size_mm": PIXEL_MM}
    (found,) = open_pipeline("texture", arguments).items()
    known = (24 * 32 - 15) * PIXEL_MM**2
    assert found["texture"]["texture_area_mm2"] == pytest.approx(known)


def test_texture_is_the_same_with_or_without_the_size(tmp_path: Path) -> None:
    file = stored(tmp_path, "npy", {"pixel_size_mm": PIXEL_MM})
    found = []
    for more in ({}, {"pixel_size_mm": PIXEL_MM}):
        graph = open_pipeline("texture", {"height": file, **more})
        found.extend(result["texture"] for result in graph.items())
    assert found[0] == found[1]
    assert found[0]["texture_area_mm2"] == pytest.approx(24 * 32 * PIXEL_MM**2)
