"""PoCL's built-in functions, declared only as far as a program names them.

PoCL has its compiler read 14,500 declarations before each program, which takes longer than most
kernels do.  So a program brings those of the names in it, all overloads of each, from the same
file, which the compiler then leaves out by the file's own guard.
"""

import re
from functools import cache
from pathlib import Path

HEADER_GUARD = "_OPENCL_H_"
"""The macro by which the file is read once."""
_POCL_LIBRARY = re.compile(r"/\S+/libpocl\.so\S*")


def with_builtins(source: str) -> tuple[str, tuple[str, ...]] | None:
    """Return a source that declares what it calls, and the options for it.

    None where the file is not found beside PoCL's library.
    """
    names = set(re.findall(r"\w+", source))
    declared = [line for name, line in _declarations() if name is None or name in names]
    if not declared:
        return None
    return "\n".join([*declared, "#line 1", source]), (f"-D{HEADER_GUARD}",)


@cache
def _declarations() -> list[tuple[str | None, str]]:
    """The lines of the file, and the function that each declares; [] without it."""
    try:
        maps = Path("/proc/self/maps").read_text(encoding="utf-8")
    except OSError:  # not Linux
        return []
    match = _POCL_LIBRARY.search(maps)
    folders = Path(match[0]).parents if match else ()
    files = (folder / "share/pocl/include/opencl-c.h" for folder in folders)
    file = next((file for file in files if file.is_file()), None)
    if file is None:
        return []
    lines = file.read_text(encoding="utf-8").splitlines()
    # Without its guard, and the types, which PoCL reads before.
    kernels = (
        line for line in lines if HEADER_GUARD not in line and not line.startswith("#include")
    )
    return [(_declares(line), line) for line in kernels]


def _declares(line: str) -> str | None:
    """The function that a line declares, where it is whole."""
    if "__ovld" not in line or not line.endswith(";"):
        return None
    return line.partition("(")[0].split()[-1]
