"""Digital Surf's files say the same heights to whoever reads them."""

from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes import F4
from tactograph.nodes.files.height_files import HeightFile
from tactograph.nodes.write.read_height import read_height
from tactograph.rings.export.nodes.export_height import export_height

PIXEL = 0.05


def slope() -> F4:
    """A ramp with a step and a corner that was not seen: nothing in it is symmetric."""
    y, x = np.mgrid[:24, :32]
    height = np.asarray(0.01 * x + 0.02 * y + 0.5 * ((x > 20) & (y < 8)), np.float32)
    height[:3, :5] = np.nan
    return height


@pytest.fixture
def exported(tmp_path: Path) -> Path:
    export_height(slope(), PIXEL, folder=tmp_path, formats=("sur",))
    return tmp_path


def test_what_is_written_is_read_back_with_its_pixel_size(exported: Path) -> None:
    found = HeightFile.read(exported / "height.sur")
    np.testing.assert_allclose(found.height, slope(), rtol=0, atol=1.01e-7)
    assert found.pixel == pytest.approx(PIXEL)


def test_a_sur_is_read_by_a_surface_metrology_package_in_micrometres(exported: Path) -> None:
    from surfalize import Surface

    surface = Surface.load(str(exported / "height.sur"))
    np.testing.assert_allclose(surface.data, 1000 * slope(), atol=1e-4)
    assert surface.step_x == surface.step_y == pytest.approx(1000 * PIXEL)
    assert (exported / "height.sur").read_bytes()[:512].count(b"\xb5m ") == 6


@pytest.mark.parametrize("end", [0, 11, 100, 511, 600, -1])
def test_a_damaged_file_is_refused_wherever_it_ends(exported: Path, end: int) -> None:
    cut = exported / "cut.sur"
    cut.write_bytes((exported / "height.sur").read_bytes()[:end])
    with pytest.raises(InputError, match=r"cut\.sur"):
        read_height(file=cut)


def test_a_sur_cannot_hold_a_height_map_that_is_level(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="all heights are the same"):
        export_height(np.zeros((4, 5), np.float32), PIXEL, folder=tmp_path, formats=("sur",))
    assert not list(tmp_path.iterdir())


def test_a_sur_that_asks_for_more_heights_than_a_sensor_has_is_refused(exported: Path) -> None:
    content = bytearray((exported / "height.sur").read_bytes())
    content[108:116] = b"\xff\xff\xff\x7f" * 2
    (exported / "huge.sur").write_bytes(content)
    with pytest.raises(InputError, match="which no sensor has"):
        read_height(file=exported / "huge.sur")
