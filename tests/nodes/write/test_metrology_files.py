"""X3P and Gwyddion's files, read back here and by the packages of their own."""

from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes import F4
from tactograph.nodes.files.height_files import read_height_file
from tactograph.nodes.write.export_height import export_height
from tactograph.nodes.write.read_error import read_error

PIXEL = 0.05
pytestmark = pytest.mark.slow  # needs the packages of tactograph[metrology]
KINDS = ("x3p", "gwy", "gsf")


@pytest.fixture
def height() -> F4:
    """Uneven sides and an unknown pixel."""
    z = np.random.default_rng(5).normal(0, 0.3, (13, 21)).astype(np.float32)
    z[4, 7] = np.nan
    return z


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_is_read_back(tmp_path: Path, height: F4, kind: str) -> None:
    export_height(height, PIXEL, folder=tmp_path, formats=(kind,))
    found = read_height_file(tmp_path / f"height.{kind}")
    np.testing.assert_allclose(found.height, height, rtol=1e-6)
    assert found.pixel == pytest.approx(PIXEL)


def test_x3pio_reads_height_and_error_in_metres(tmp_path: Path, height: F4) -> None:
    import x3pio

    export_height(height, PIXEL, error=0.1 * abs(height), folder=tmp_path, formats=("x3p",))
    layers = x3pio.read(tmp_path / "height.x3p").layers
    np.testing.assert_allclose(layers[0].z, 1e-3 * height, rtol=1e-6)
    np.testing.assert_allclose(layers[1].z, 1e-4 * abs(height), rtol=1e-5)
    found = read_error(height=tmp_path / "height.x3p")
    np.testing.assert_allclose(found, 0.1 * abs(height), rtol=1e-5)
    assert layers[0].spacing == pytest.approx((5e-5, 5e-5))


def test_gwyfile_reads_height_and_error_in_metres(tmp_path: Path, height: F4) -> None:
    import gwyfile

    known = np.nan_to_num(height)
    export_height(known, PIXEL, error=0.1 * abs(known), folder=tmp_path, formats=("gwy",))
    fields = gwyfile.util.get_datafields(gwyfile.load(str(tmp_path / "height.gwy")))
    np.testing.assert_allclose(fields["Height"].data, 1e-3 * known, rtol=1e-6)
    np.testing.assert_allclose(fields["Error"].data, 1e-4 * abs(known), rtol=1e-5)
    found = read_error(height=tmp_path / "height.gwy")
    np.testing.assert_allclose(found, 0.1 * abs(known), rtol=1e-5)
    assert fields["Height"].xreal == pytest.approx(21 * 5e-5)


def test_gsffile_reads_the_height_in_metres(tmp_path: Path, height: F4) -> None:
    import gsffile

    export_height(height, PIXEL, folder=tmp_path, formats=("gsf",))
    data, about = gsffile.read_gsf(tmp_path / "height.gsf")
    np.testing.assert_allclose(data, 1e-3 * height, rtol=1e-6)
    assert about["YReal"] == pytest.approx(13 * 5e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_file_is_refused_in_one_line(tmp_path: Path, height: F4, kind: str) -> None:
    export_height(height, PIXEL, folder=tmp_path, formats=(kind,))
    file = tmp_path / f"height.{kind}"
    file.write_bytes(file.read_bytes()[:60])
    with pytest.raises(InputError, match=rf"cannot be read as a .{kind} file"):
        read_height_file(file)
