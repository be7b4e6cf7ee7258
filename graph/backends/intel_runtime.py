"""Intel's OpenCL runtime for CPUs, as installed by the Python package `intel-opencl-rt`.

The package does not register its driver with the OpenCL loader; /etc and the registry belong to
the administrator.  Loaders on Linux read the folder that OCL_ICD_VENDORS names in place of the
system's, so `listed` names a folder that holds both the system's drivers and this one.  On Windows
the loader of Khronos loads the drivers that OCL_ICD_FILENAMES names before those of the registry.
"""

import os
import platform
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

_DRIVER_FILES = {"linux": "libintelocl.so", "win32": "intelocl64.dll"}
"""The driver's file, by `sys.platform`; on Windows it lies in the environment's `Library/bin`."""


@contextmanager
def listed() -> Iterator[None]:
    """List the runtime while the loader searches for drivers, which it does once per process.

    Nothing changes if the package is absent, if the system lists the runtime itself, or if the user
    has set the variable.
    """
    runtime = _runtime()
    if runtime is None:
        yield
    elif sys.platform == "win32":
        # The driver's libraries are beside it, where older loaders do not search.
        with os.add_dll_directory(str(runtime.parent)), _named("OCL_ICD_FILENAMES", str(runtime)):
            yield
    else:
        with _beside_the_systems(runtime):
            yield


@contextmanager
def _beside_the_systems(runtime: Path) -> Iterator[None]:
    folders = [Path(os.environ.get("OPENCL_VENDOR_PATH") or "/etc/OpenCL/vendors")]
    folders.append(Path(sys.prefix, "etc", "OpenCL", "vendors"))  # conda's loader
    drivers = [line for folder in folders for line in _drivers(folder)]
    if any(Path(driver).name.startswith(_DRIVER_FILES["linux"]) for driver in drivers):
        yield
        return
    with tempfile.TemporaryDirectory(prefix="tactograph-") as folder:
        for number, driver in enumerate([str(runtime), *drivers]):
            Path(folder, f"{number}.icd").write_text(driver, encoding="utf-8")
        with _named("OCL_ICD_VENDORS", folder):
            yield


@contextmanager
def _named(variable: str, value: str) -> Iterator[None]:
    """Set an environment variable for a while, unless the user has set it."""
    if os.environ.get(variable):
        yield
        return
    os.environ[variable] = value
    try:
        yield
    finally:
        del os.environ[variable]


def is_for_this_system() -> bool:
    """Return whether the package has files for this system and processor."""
    return sys.platform in _DRIVER_FILES and platform.machine().lower() in ("x86_64", "amd64")


def _runtime() -> Path | None:
    """The package's driver, if it is installed."""
    try:
        files = distribution("intel-opencl-rt").files or []
    except PackageNotFoundError:
        return None
    name = _DRIVER_FILES.get(sys.platform)
    paths = (Path(str(file.locate())).resolve() for file in files if file.name == name)
    return next((path for path in paths if path.is_file()), None)


def _drivers(folder: Path) -> list[str]:
    """The existing libraries that a folder of .icd files lists.

    The package leaves .icd files in `sys.prefix` whose paths only conda's installer corrects.
    """
    try:
        lines = [file.read_text(encoding="utf-8").strip() for file in sorted(folder.glob("*.icd"))]
    except OSError:
        return []
    return [line for line in lines if not Path(line).is_absolute() or Path(line).is_file()]
