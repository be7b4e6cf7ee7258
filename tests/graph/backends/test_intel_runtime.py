"""The runtime that a Python package brings is found without root and beside the system's own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

POCL = [*Path("/usr/lib").glob("*/libpocl.so.*"), *Path("/usr/lib64").glob("libpocl.so.*")]
PLATFORMS = (
    "import os;"
    "from tactograph.graph.backends.devices import find_devices;"
    "print([d.name for d in find_devices()], os.environ.get('OCL_ICD_VENDORS'))"
)


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A folder of Python packages with `intel-opencl-rt`, whose driver is PoCL's."""
    if not POCL:
        pytest.skip("PoCL's library, which stands in for Intel's, is not in /usr/lib")
    (tmp_path / "libintelocl.so").symlink_to(POCL[0])
    info = tmp_path / "intel_opencl_rt-2026.2.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: intel-opencl-rt\nVersion: 2026.2.0"
    )
    (info / "RECORD").write_text("libintelocl.so,,\nintel_opencl_rt-2026.2.0.dist-info/RECORD,,\n")
    return tmp_path


def devices(**environment: object) -> str:
    """What a fresh process finds, and what it leaves in the environment."""
    done = subprocess.run(
        [sys.executable, "-c", PLATFORMS],
        env={**os.environ, **{name: str(value) for name, value in environment.items()}},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


def test_it_is_found_where_the_system_lists_no_driver(package: Path, tmp_path: Path) -> None:
    nothing = tmp_path / "nothing"
    nothing.mkdir()
    assert "Portable" not in devices(OPENCL_VENDOR_PATH=nothing)
    found = devices(OPENCL_VENDOR_PATH=nothing, PYTHONPATH=package)
    assert "Portable" in found
    assert found.endswith("None\n"), "what other processes inherit is as it was"


def test_the_drivers_that_the_system_lists_are_still_found(package: Path, tmp_path: Path) -> None:
    """A driver that is no library keeps the loader from nothing else."""
    (package / "libintelocl.so").unlink()
    (package / "libintelocl.so").write_text("no library")
    system = tmp_path / "vendors"
    system.mkdir()
    (system / "pocl.icd").write_text(f"{POCL[0]}\n")
    assert "Portable" in devices(OPENCL_VENDOR_PATH=system, PYTHONPATH=package)


def test_what_the_user_names_is_kept(package: Path, tmp_path: Path) -> None:
    own = tmp_path / "own"
    own.mkdir()
    found = devices(OCL_ICD_VENDORS=own, PYTHONPATH=package)
    assert "Portable" not in found
    assert found.endswith(f"{own}\n")


def test_where_the_system_lists_a_runtime_of_its_own_the_package_adds_none(
    package: Path, tmp_path: Path
) -> None:
    """Two runtimes of one maker in a process would share their global state."""
    system = tmp_path / "vendors"
    system.mkdir()
    (system / "libintelocl.so").write_text("the system's")
    (system / "intel.icd").write_text(f"{system / 'libintelocl.so'}\n")
    assert "Portable" not in devices(OPENCL_VENDOR_PATH=system, PYTHONPATH=package)
