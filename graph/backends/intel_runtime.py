"""Intel's OpenCL runtime for CPUs, where the Python package `intel-opencl-rt` brings it.

The package lists its driver nowhere that an OpenCL loader looks, and /etc belongs to root.
Loaders on Linux read the folder that OCL_ICD_VENDORS names in place of the system's, so
`listed` names a folder that holds both the system's drivers and this one.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

_DRIVER = "libintelocl.so"


@contextmanager
def listed() -> Iterator[None]:
    """List the runtime while the loader looks for drivers, which it does once a process.

    Nothing changes where the package is absent, where the system lists the runtime itself,
    or where the user has set OCL_ICD_VENDORS.
    """
    folders = [Path(os.environ.get("OPENCL_VENDOR_PATH") or "/etc/OpenCL/vendors")]
    folders.append(Path(sys.prefix, "etc", "OpenCL", "vendors"))  # conda's loader
    drivers = [line for folder in folders for line in _drivers(folder)]
    runtime = _runtime()
    if os.environ.get("OCL_ICD_VENDORS") or runtime is None or any(map(_is_intel, drivers)):
        yield
        return
    with tempfile.TemporaryDirectory(prefix="tactograph-") as folder:
        for number, driver in enumerate([str(runtime), *drivers]):
            Path(folder, f"{number}.icd").write_text(driver, encoding="utf-8")
        os.environ["OCL_ICD_VENDORS"] = folder
        try:
            yield
        finally:
            del os.environ["OCL_ICD_VENDORS"]


def _runtime() -> Path | None:
    """The driver that the package brought, if it is installed and this is Linux."""
    if not sys.platform.startswith("linux"):
        return None
    try:
        files = distribution("intel-opencl-rt").files or []
    except PackageNotFoundError:
        return None
    found = (Path(str(file.locate())).resolve() for file in files if file.name == _DRIVER)
    return next((path for path in found if path.is_file()), None)


def _drivers(folder: Path) -> list[str]:
    """The libraries that a folder of .icd files lists, without those that are not there.

    The package leaves .icd files in `sys.prefix` whose paths only conda's installer corrects.
    """
    try:
        lines = [file.read_text(encoding="utf-8").strip() for file in sorted(folder.glob("*.icd"))]
    except OSError:
        return []
    return [line for line in lines if not Path(line).is_absolute() or Path(line).is_file()]


def _is_intel(driver: str) -> bool:
    return Path(driver).name.startswith(_DRIVER)
