"""A gel's modulus and thickness from presses of known force."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from rings.mechanics.tests.force.presses import F8, FORCE, MODULUS, PEAK, PIXEL, RADIUS, height
from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.graph.files.read_graph import read_graph, with_overlays
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes.files.height_files import write_tiff
from tactograph.rings.mechanics.nodes.force.calibrate_force import calibrate_force

SHARES = (0.5, 0.8, 1.0)
RADII = (0.8, 1.6, 2.4)


def results(folder: Path, heights: Iterable[F8]) -> None:
    """Results of presses, as `write_result` leaves them."""
    for number, z in enumerate(heights):
        (folder / f"press{number}").mkdir(parents=True)
        write_tiff(folder / f"press{number}" / "height.tiff", z.astype(np.float32), PIXEL)


def press(folder: Path, thickness: float) -> tuple[float, ...]:
    """Results of three presses, and their forces in newtons."""
    results(folder, [height(thickness, 0.48, peak=share * PEAK) for share in SHARES])
    return tuple(share * FORCE for share in SHARES)


def test_the_modulus_is_found_where_the_thickness_is_known(tmp_path: Path) -> None:
    forces = press(tmp_path, 2.5)
    figures = calibrate_force(results=tmp_path, force_n=forces, thickness_mm=2.5)
    assert figures["modulus_kpa"] == pytest.approx(MODULUS, rel=0.05)
    assert figures["modulus_error"] < 0.03


def test_presses_of_different_radii_tell_the_thickness(tmp_path: Path) -> None:
    results(tmp_path, [height(1.5, 0.48, radius) for radius in RADII])
    forces = tuple(FORCE * (radius / RADIUS) ** 2 for radius in RADII)
    with collect_warnings([]) as notes:
        figures = calibrate_force(results=tmp_path, force_n=forces)
    assert not notes, "of the thicknesses that were tried"
    assert figures["thickness_mm"] == pytest.approx(1.5, rel=0.25)
    assert figures["modulus_kpa"] == pytest.approx(MODULUS, rel=0.15)


@pytest.mark.parametrize(
    ("presses", "force_n", "thickness", "folder", "message"),
    [
        (3, (1.0, 1.0), 2.5, "", "holds 3 results, but `force_n` names 2 forces"),
        (2, (1.0, 1.0), None, "", "do not tell modulus and thickness apart"),
        (3, SHARES, None, "", "too alike to tell the thickness"),
        (3, (1e-9, 1e-9, 1e-9), 2.5, "", "kPa, which no gel has: are forces in newtons"),
        (3, SHARES, 0.06, "", r"mm deep, more than a gel of 0\.06 mm is thick"),
        (3, (1.0,), 2.5, "nowhere", "there is no such folder of results"),
        (3, (1.0,), 2.5, "press1", "press1: is one result; give the folder that holds one"),
    ],
)
def test_presses_that_tell_no_modulus_are_refused(
    presses: int, force_n: tuple[float, ...], thickness: float | None, folder: str, message: str,
    tmp_path: Path,
) -> None:  # fmt: skip
    press(tmp_path, 2.5)
    for number in range(presses, 3):
        (tmp_path / f"press{number}" / "height.tiff").unlink()
    with pytest.raises(InputError, match=message):
        calibrate_force(results=tmp_path / folder, force_n=force_n, thickness_mm=thickness)


def test_one_press_tells_no_error(tmp_path: Path) -> None:
    results(tmp_path, [height(2.5, 0.48)])
    figures = calibrate_force(results=tmp_path, force_n=(FORCE,), thickness_mm=2.5)
    assert {*figures} == {"modulus_kpa", "thickness_mm", "thickness_percent"}


def stream(folder: Path, noise: float, seed: int = 1) -> list[tuple[str, float]]:
    """Frames of a ball that presses deeper and deeper, and a force gauge that errs."""
    rng = np.random.default_rng(seed)
    shares = np.linspace(0.4, 1, 8)
    results(folder, [height(2.5, 0.48, peak=share * PEAK) for share in shares])
    read = shares * FORCE * (1 + noise * rng.standard_normal(shares.size))
    return [(f"press{number}", float(newtons)) for number, newtons in enumerate(read)]


def table(file: Path, rows: list[tuple[str, float]]) -> Path:
    file.write_text("name,force_n\n" + "".join(f"{name},{n}\n" for name, n in rows))
    return file


@pytest.mark.one_case
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_each_press_is_held_out_of_a_stream(noise: float, tmp_path: Path) -> None:
    rows = stream(tmp_path / "frames", noise)
    gel = {"results": tmp_path / "frames", "forces": table(tmp_path / "gauge.csv", rows[1:])}
    with open_pipeline("calibrate_force", gel | {"thickness_mm": 2.5}) as pipeline:
        ((figures,),) = (tuple(item.outputs.values()) for item in pipeline.items())
    assert figures["modulus_kpa"] == pytest.approx(MODULUS, rel=0.05)
    assert figures["held_out_percent"] == pytest.approx(100 * noise, rel=0.6, abs=0.1)
    assert abs(figures["modulus_kpa"] / MODULUS - 1) < 2 * figures["modulus_error"]


def test_the_thickness_adds_its_share_of_the_error(tmp_path: Path) -> None:
    forces = press(tmp_path, 2.5)
    arguments = {"results": tmp_path, "force_n": forces}
    known = calibrate_force(**arguments, thickness_mm=2.5, thickness_error_mm=0.25)
    thicker = calibrate_force(**arguments, thickness_mm=2.75)
    change = 100 * abs(np.log(thicker["modulus_kpa"] / known["modulus_kpa"]))
    assert known["thickness_percent"] == pytest.approx(change, rel=0.2)
    assert known["modulus_error"] > known["thickness_percent"] / 100


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,force_n\npress9,1\n", "no result is called press9"),
        ("name,force_n\n", "names no force"),
        ("name,force\npress0,1\n", "needs the columns name and force_n"),
        ("name,force_n\npress0,much\n", "needs the columns name and force_n"),
        ("name,force_n\npress0,-1\n", "with a force above 0 N"),
        ("name,force_n\npress0,1\npress0,2\n", "each name needs one row"),
    ],
)
def test_tables_that_name_no_force_are_refused(text: str, message: str, tmp_path: Path) -> None:
    press(tmp_path / "frames", 2.5)
    file = tmp_path / "gauge.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=message):
        calibrate_force(results=tmp_path / "frames", forces=file, thickness_mm=2.5)
    with pytest.raises(InputError, match="cannot be read"):
        calibrate_force(results=tmp_path / "frames", forces=tmp_path / "no.csv", thickness_mm=2.5)
    with pytest.raises(InputError, match="one of both"):
        calibrate_force(results=tmp_path / "frames", thickness_mm=2.5)


@pytest.mark.parametrize("gel", [(0.2, 4.0), (2e5, 4.0), (200.0, 1e-9), (200.0, 4000.0)])
def test_a_modulus_in_other_units_is_refused(gel: tuple[float, float]) -> None:
    arguments = {"modulus_kpa": gel[0], "thickness_mm": gel[1], "capture": "x", "calibration": "x"}
    with pytest.raises(InputError, match=r"input should be (less|greater) than or equal to"):
        open_pipeline(with_overlays(read_graph("reconstruct"), ["force"]), arguments, sinks=False)
