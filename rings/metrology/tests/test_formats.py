"""X3P and Gwyddion's files, read back here and by the packages of their own."""

import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4
from tactograph.nodes.files.height_files import HeightFile
from tactograph.rings.export.nodes.export_height import export_height
from tactograph.rings.export.nodes.read_error import read_error

PIXEL = 0.05
pytestmark = pytest.mark.slow  # needs the packages of tactograph[metrology]
KINDS = ("x3p", "gwy")


@pytest.fixture
def height() -> F4:
    """Uneven sides and an unknown pixel."""
    z = np.random.default_rng(5).normal(0, 0.3, (13, 21)).astype(np.float32)
    z[4, 7] = np.nan
    return z


def read_x3p(file: Path) -> tuple[F4, F4, float]:
    import x3pio

    layers = x3pio.read(file).layers
    return layers[0].z, layers[1].z, layers[0].spacing[1]


def read_gwy(file: Path) -> tuple[F4, F4, float]:
    import gwyfile

    container = gwyfile.load(str(file))
    fields = gwyfile.util.get_datafields(container)
    height = np.where(container["/0/mask"].data > 0, np.nan, fields["Height"].data)
    return height, fields["Error"].data, fields["Height"].yreal / 13


@pytest.mark.parametrize("read", [read_x3p, read_gwy])
def test_height_and_error_are_read_back_here_and_by_the_packages_own_reader(
    tmp_path: Path, height: F4, read: Callable[[Path], tuple[F4, F4, float]]
) -> None:
    """In mm here, in metres there."""
    kind, error = read.__name__[5:], 0.1 * abs(np.nan_to_num(height))
    export_height(height, PIXEL, error=error, folder=tmp_path, formats=(kind,))
    file = tmp_path / f"height.{kind}"
    found, theirs = HeightFile.read(file), read(file)
    np.testing.assert_allclose(found.height, height, rtol=1e-6)
    np.testing.assert_allclose(theirs[0], 1e-3 * height, rtol=1e-6)
    assert (found.pixel, 1e3 * theirs[2]) == (pytest.approx(PIXEL), pytest.approx(PIXEL))
    np.testing.assert_allclose(theirs[1], 1e-3 * error, rtol=1e-5)
    np.testing.assert_allclose(read_error(height=file), error, rtol=1e-5)


@pytest.mark.parametrize("end", [0, 60, -1])
@pytest.mark.parametrize("kind", KINDS)
def test_a_file_cut_short_is_one_line(tmp_path: Path, height: F4, kind: str, end: int) -> None:
    export_height(height, PIXEL, folder=tmp_path, formats=(kind,))
    file = tmp_path / f"height.{kind}"
    file.write_bytes(file.read_bytes()[:end])
    with pytest.raises(InputError, match=rf"damaged or no .{kind} file"):
        HeightFile.read(file)


def test_millimetres_where_metres_belong_are_asked_about(tmp_path: Path) -> None:
    import x3pio

    file = tmp_path / "height.x3p"
    x3pio.write(file, np.ones((1, 4, 5)), x_scale=0.027, y_scale=0.027)
    with pytest.raises(InputError, match="27 mm per px; are its lengths in mm"):
        HeightFile.read(file)


def _rewritten(file: Path, change: Callable[[bytes], bytes]) -> None:
    """Change ``main.xml`` in a file, and leave its checksum."""
    with zipfile.ZipFile(file) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    members["main.xml"] = change(members["main.xml"])
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace(b"ISO5436_2", b"ISO5436"), "its root is ISO5436"),
        (lambda text: text + b"\n", "was changed since its checksum was made"),
    ],
)
def test_foreign_roots_and_stale_checksums_are_read_with_a_warning(
    tmp_path: Path, height: F4, change: Callable[[bytes], bytes], message: str
) -> None:
    export_height(height, PIXEL, folder=tmp_path, formats=("x3p",))
    file = tmp_path / "height.x3p"
    _rewritten(file, change)
    with collect_warnings([]) as lines:
        found = HeightFile.read(file)
    assert len(lines) == 1
    assert message in lines[0]
    np.testing.assert_allclose(found.height, height, rtol=1e-6)
