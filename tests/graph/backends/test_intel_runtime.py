"""The runtime of a Python package is found without root, in addition to the system's own."""

import os
import sys
from contextlib import nullcontext
from pathlib import Path

import pytest

from tactograph.graph.backends import devices as opencl_devices
from tactograph.graph.backends.intel_runtime import listed
from tests.fixtures import python

POCL = [*Path("/usr/lib").glob("*/libpocl.so.*"), *Path("/usr/lib64").glob("libpocl.so.*")]
METADATA = "Metadata-Version: 2.1\nName: intel-opencl-rt\nVersion: 2026.2.0"
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
    (info / "METADATA").write_text(METADATA)
    (info / "RECORD").write_text("libintelocl.so,,\nintel_opencl_rt-2026.2.0.dist-info/RECORD,,\n")
    return tmp_path


def devices(**environment: object) -> str:
    """The drivers that a fresh process finds, and the environment that it leaves."""
    return python("-c", PLATFORMS, **environment).stdout


def test_the_runtime_is_found_where_the_system_lists_no_driver(
    package: Path, tmp_path: Path
) -> None:
    nothing = tmp_path / "nothing"
    nothing.mkdir()
    assert "Portable" not in devices(OPENCL_VENDOR_PATH=nothing)
    output = devices(OPENCL_VENDOR_PATH=nothing, PYTHONPATH=package)
    assert "Portable" in output
    assert output.endswith("None\n"), "the inherited environment is unchanged"


def test_the_drivers_that_the_system_lists_are_still_found(package: Path, tmp_path: Path) -> None:
    """A file that is no library does not keep the loader from other drivers."""
    (package / "libintelocl.so").unlink()
    (package / "libintelocl.so").write_text("no library")
    system = tmp_path / "vendors"
    system.mkdir()
    (system / "pocl.icd").write_text(f"{POCL[0]}\n")
    assert "Portable" in devices(OPENCL_VENDOR_PATH=system, PYTHONPATH=package)


def test_a_folder_of_drivers_that_the_user_names_is_kept(package: Path, tmp_path: Path) -> None:
    folder = tmp_path / "drivers"
    folder.mkdir()
    output = devices(OCL_ICD_VENDORS=folder, PYTHONPATH=package)
    assert "Portable" not in output
    assert output.endswith(f"{folder}\n")


def test_the_package_adds_no_runtime_where_the_system_lists_one(
    package: Path, tmp_path: Path
) -> None:
    """Two runtimes of one maker in a process would share their global state."""
    system = tmp_path / "vendors"
    system.mkdir()
    (system / "libintelocl.so").write_text("the system's")
    (system / "intel.icd").write_text(f"{system / 'libintelocl.so'}\n")
    assert "Portable" not in devices(OPENCL_VENDOR_PATH=system, PYTHONPATH=package)


def test_on_windows_the_runtime_is_found_where_the_package_puts_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An artificial environment, filled as by the wheel for Windows."""
    driver, packages = tmp_path / "Library/bin/intelocl64.dll", tmp_path / "Lib/site-packages"
    info = packages / "intel_opencl_rt-2026.2.0.dist-info"
    driver.parent.mkdir(parents=True)
    info.mkdir(parents=True)
    driver.write_text("a driver")
    (info / "METADATA").write_text(METADATA)
    (info / "RECORD").write_text("../../Library/bin/intelocl64.dll,,\n")
    searched: list[str] = []

    def add(folder: str) -> nullcontext[None]:
        searched.append(folder)
        return nullcontext()

    monkeypatch.syspath_prepend(packages)
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(os, "add_dll_directory", add, raising=False)
    monkeypatch.delenv("OCL_ICD_FILENAMES", raising=False)
    with listed():
        assert os.environ["OCL_ICD_FILENAMES"] == str(driver)
        assert searched == [str(driver.parent)]
    assert "OCL_ICD_FILENAMES" not in os.environ
    monkeypatch.setenv("OCL_ICD_FILENAMES", "the user's")
    with listed():
        assert os.environ["OCL_ICD_FILENAMES"] == "the user's"


@pytest.mark.parametrize(
    ("system", "processor", "advice"),
    [
        ("linux", "x86_64", 'pip install "tactograph[cpu]"'),
        ("win32", "AMD64", 'pip install "tactograph[cpu]"'),
        ("linux", "aarch64", "pocl"),
        ("darwin", "arm64", "macOS includes one"),
    ],
)
def test_the_reason_why_no_device_works_says_how_to_install_one(
    system: str, processor: str, advice: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(opencl_devices, "_handles", lambda: iter(()))
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr("platform.machine", lambda: processor)
    device, reason = opencl_devices.choose_device()
    assert device is None
    assert reason.startswith("no OpenCL device works here; ")
    assert advice in reason
