"""Softgauges: surfaces whose parameters follow from a formula, in files of ISO 25178-71 and -72.

The packages of others write the files; `texture` and `measure_step` read them.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from benchmarks.one_run import run
from rings.metrology.tests.scan.scans import groove_shape
from tactograph.graph import InputError
from tactograph.nodes import F8
from tactograph.nodes.files.height_files import HeightFile
from tactograph.rings.export.nodes.export_height import export_height

pytestmark = pytest.mark.slow  # needs the packages of tactograph[metrology]
PIXEL_UM, ROWS, COLUMNS = 2.0, 400, 1001
MOST_OFF = 1e-3
"""0.1 %, of the value that the formula gives."""
Y, X = PIXEL_UM * (np.indices((ROWS, COLUMNS)) - (np.array([ROWS, COLUMNS])[:, None, None] - 1) / 2)
WIDTH_UM = PIXEL_UM * (COLUMNS - 1)


def write_x3p(file: Path, surface_um: F8) -> None:
    import x3pio

    side = 1e-6 * PIXEL_UM
    x3pio.write(file, 1e-6 * surface_um[None], x_scale=side, y_scale=side)


def write_sdf(file: Path, surface_um: F8) -> None:
    from surfalize import Surface

    Surface(surface_um, PIXEL_UM, PIXEL_UM).save(str(file))


def write_text_sdf(file: Path, surface_um: F8) -> None:
    from surfalize import Surface

    Surface(surface_um, PIXEL_UM, PIXEL_UM).save(str(file), binary=False)


Write = Callable[[Path, F8], None]
WRITERS = pytest.mark.parametrize("write", [write_sdf, write_text_sdf, write_x3p])


def file_of(folder: Path, write: Write, surface_um: F8) -> Path:
    file = folder / f"gauge.{write.__name__.rpartition('_')[2]}"
    write(file, surface_um)
    return file


def check_texture(file: Path, degree: int, **expected: float) -> None:
    found = run("texture", height=file, form_degree=degree)["texture"]
    for name, value in expected.items():
        assert found[f"{name}_um"] == pytest.approx(value, rel=MOST_OFF), name


@WRITERS
@pytest.mark.parametrize("amplitude_um", [0.5, 20.0])
def test_a_sine(write: Write, amplitude_um: float, tmp_path: Path) -> None:
    """2 A / pi, A / sqrt(2) and 2 A of whole waves, even about the middle, on a tilted plane."""
    wave_um = PIXEL_UM * COLUMNS / 12
    surface = amplitude_um * np.cos(2 * np.pi * X / wave_um) + 0.01 * X - 0.02 * Y
    sine = {"Sa": 2 / np.pi, "Sq": np.sqrt(1 / 2), "Sz": 2.0}
    check_texture(
        file_of(tmp_path, write, surface), 1, **{n: amplitude_um * s for n, s in sine.items()}
    )


@WRITERS
def test_an_inclined_plane(write: Write, tmp_path: Path) -> None:
    """h / 4, h / sqrt(12) and h of a plane that rises by h over the width."""
    rise_um = 50.0
    surface = rise_um * X / WIDTH_UM
    plane = {"Sa": rise_um / 4, "Sq": rise_um / np.sqrt(12), "Sz": rise_um}
    # Points at the pixels' middles: their mean square is that of the width and half a pixel more.
    plane["Sq"] *= np.sqrt((COLUMNS + 1) / (COLUMNS - 1))
    plane["Sa"] *= (COLUMNS + 1) / COLUMNS
    check_texture(file_of(tmp_path, write, surface), 0, **plane)


@WRITERS
def test_a_chess_board(write: Write, tmp_path: Path) -> None:
    """Half a step above and below its mean: h / 2, h / 2 and h."""
    step_um = 5.0
    surface = step_um / 2 * np.sign(np.sin(2 * np.pi * (X + 1e-3) / 200)) * np.sign(Y)
    board = {"Sa": step_um / 2, "Sq": step_um / 2, "Sz": step_um}
    check_texture(file_of(tmp_path, write, surface), 0, **board)


@WRITERS
@pytest.mark.parametrize("depth_um", [1.0, 50.0])
def test_a_groove_and_a_step(write: Write, depth_um: float, tmp_path: Path) -> None:
    """Their depth; a groove's on a tilted surface."""
    groove = 1e3 * groove_shape(1e-3 * depth_um, 45, 0.5, (ROWS, COLUMNS), 1e-3 * PIXEL_UM)
    step = np.where(X > 0, -depth_um, 0.0)
    for surface, edges in ((groove + 1e-3 * X, 2), (step, 1)):
        file = file_of(tmp_path, write, surface)
        found = run("measure_step", height=file, edges=edges)["step"]
        assert found["step_depth_um"] == pytest.approx(depth_um, rel=MOST_OFF)


def test_an_exported_softgauge_is_read_back(tmp_path: Path) -> None:
    height = np.asarray(1e-3 * X[:20, :30] + 0.01, np.float32)
    height[3, 4] = np.nan
    export_height(height, 1e-3 * PIXEL_UM, folder=tmp_path, formats=("sdf",))
    found = HeightFile.read(tmp_path / "height.sdf")
    np.testing.assert_allclose(found.height, height, rtol=1e-6)
    assert found.pixel == pytest.approx(1e-3 * PIXEL_UM)
    (tmp_path / "height.sdf").write_bytes((tmp_path / "height.sdf").read_bytes()[:200])
    with pytest.raises(InputError, match=r"height\.sdf: cut off, damaged or no \.sdf file"):
        HeightFile.read(tmp_path / "height.sdf")
