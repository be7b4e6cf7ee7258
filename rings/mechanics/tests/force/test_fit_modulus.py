"""A gel's modulus and thickness from presses of known force."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from rings.mechanics.tests.force.presses import (
    F8,
    FORCE,
    MODULUS,
    PIXEL,
    RADIUS,
    displacement,
    height,
)
from tactograph.graph import InputError
from tactograph.graph.files.read_graph import read_graph, with_overlays
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes.files.height_files import write_tiff
from tactograph.rings.mechanics.nodes.force.fit_modulus import fit_modulus

SHARES = (0.5, 0.8, 1.0)
RADII = (0.8, 1.6, 2.4)


def results(folder: Path, heights: Iterable[F8]) -> None:
    """Results of presses, as `write_result` leaves them."""
    for number, z in enumerate(heights):
        (folder / f"press{number}").mkdir(parents=True)
        write_tiff(folder / f"press{number}" / "height.tiff", z.astype(np.float32), PIXEL)


def press(folder: Path, thickness: float) -> tuple[float, ...]:
    """Results of three presses, and their forces in newtons."""
    results(folder, [share * height(thickness, 0.48) for share in SHARES])
    return tuple(share * FORCE for share in SHARES)


def test_the_modulus_is_found_where_the_thickness_is_known(tmp_path: Path) -> None:
    forces = press(tmp_path, 2.5)
    figures = fit_modulus(results=tmp_path, force_n=forces, thickness_mm=2.5)
    assert figures["modulus_kpa"] == pytest.approx(MODULUS, rel=0.05)
    assert figures["modulus_error"] < 0.03


def test_presses_of_different_radii_tell_the_thickness(tmp_path: Path) -> None:
    results(tmp_path, [displacement(1.5, 0.48, radius=radius) for radius in RADII])
    forces = tuple(FORCE * (radius / RADIUS) ** 2 for radius in RADII)
    figures = fit_modulus(results=tmp_path, force_n=forces)
    assert figures["thickness_mm"] == pytest.approx(1.5, rel=0.25)
    assert figures["modulus_kpa"] == pytest.approx(MODULUS, rel=0.15)


@pytest.mark.parametrize(
    ("presses", "force_n", "thickness", "folder", "told"),
    [
        (3, (1.0, 1.0), 2.5, "", "holds 3 results, but `force_n` names 2 forces"),
        (2, (1.0, 1.0), None, "", "do not tell modulus and thickness apart"),
        (3, SHARES, None, "", "too alike to tell the thickness"),
        (3, (1e-9, 1e-9, 1e-9), 2.5, "", "kPa, which no gel has: are forces in newtons"),
        (3, (1.0,), 2.5, "nowhere", "there is no such folder of results"),
        (3, (1.0,), 2.5, "press1", "press1: is one result; give the folder that holds one"),
    ],
)
def test_presses_that_tell_no_modulus_are_refused(
    presses: int, force_n: tuple[float, ...], thickness: float | None, folder: str, told: str,
    tmp_path: Path,
) -> None:  # fmt: skip
    press(tmp_path, 2.5)
    for number in range(presses, 3):
        (tmp_path / f"press{number}" / "height.tiff").unlink()
    with pytest.raises(InputError, match=told):
        fit_modulus(results=tmp_path / folder, force_n=force_n, thickness_mm=thickness)


def test_one_press_tells_no_error(tmp_path: Path) -> None:
    results(tmp_path, [height(2.5, 0.48)])
    figures = fit_modulus(results=tmp_path, force_n=(FORCE,), thickness_mm=2.5)
    assert {*figures} == {"modulus_kpa", "thickness_mm"}


@pytest.mark.parametrize("gel", [(0.2, 4.0), (2e5, 4.0), (200.0, 1e-9), (200.0, 4000.0)])
def test_a_modulus_in_other_units_is_refused(gel: tuple[float, float]) -> None:
    given = {"modulus_kpa": gel[0], "thickness_mm": gel[1], "capture": "x", "calibration": "x"}
    with pytest.raises(InputError, match=r"input should be (less|greater) than or equal to"):
        open_pipeline(with_overlays(read_graph("reconstruct"), ["force"]), given, sinks=False)
