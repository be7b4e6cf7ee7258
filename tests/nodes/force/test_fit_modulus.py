"""A gel's modulus and thickness from presses of known force."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes.files.height_files import write_tiff
from tactograph.nodes.force.fit_modulus import fit_modulus
from tests.nodes.force.presses import F8, FORCE, MODULUS, PIXEL, RADIUS, displacement, height

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


def test_too_few_forces_or_presses_are_refused(tmp_path: Path) -> None:
    forces = press(tmp_path, 2.5)
    with pytest.raises(InputError, match="holds 3 results, but force_n= names 2 forces"):
        fit_modulus(results=tmp_path, force_n=forces[:2], thickness_mm=2.5)
    (tmp_path / "press2" / "height.tiff").unlink()
    with pytest.raises(InputError, match="do not tell modulus and thickness apart"):
        fit_modulus(results=tmp_path, force_n=forces[:2])


def test_a_folder_that_is_not_there_is_told_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such folder of results"):
        fit_modulus(results=tmp_path / "nowhere", force_n=(1.0,), thickness_mm=2.0)
    press(tmp_path, 2.5)
    with pytest.raises(InputError, match="press1: is one result; give the folder that holds one"):
        fit_modulus(results=tmp_path / "press1", force_n=(1.0,), thickness_mm=2.0)
