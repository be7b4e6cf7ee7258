"""Rewrite sources so that PoCL compiles them faster, and binaries so that it reads them faster.

PoCL's compiler reads 14,500 declarations before each program, which takes longer than most kernels.
So a program contains the declarations of the names in it (all overloads of each), copied from the
same file, and the guard of that file makes the compiler skip it.

PoCL compiles the code of a kernel three times, but a function only once.  So the code of a kernel
whose lanes are filled by hand becomes a function; inlining it would gain nothing.

A binary also contains the code before its translation for the processor.  PoCL reads and keeps it
to compile a kernel again, half a MiB and 4 ms per program, even if nothing ever does that.
"""

import re
from functools import cache, partial
from pathlib import Path

HEADER_GUARD = "_OPENCL_H_"
"""The guard macro of the file of declarations."""
_POCL_LIBRARY = re.compile(r"/\S+/libpocl\.so\S*")
_LANED_KERNEL = re.compile(
    r"^LANED __kernel void (\w+)\(([^()]*)\)\s*(\{.*?^\})", re.DOTALL | re.MULTILINE
)
_UNTRANSLATED_CODE = re.compile(rb"([A-P]{2}/[A-P]+)[A-P](\0.{12}/program)\.bc", re.DOTALL)
"""In a binary, the name of its folder in PoCL's cache, and that of its untranslated code."""
_PARAMETER_LIST = re.compile(r"#define (\w+_PARAMETERS)\b((?:.*\\\n)+.*)")
"""A macro that holds several parameters of a kernel."""
_PLACE_NAME = re.compile(r"GRID_[23]|get_(local|group)|barrier|__local")
"""Names in code that uses more than the work-item's first number, or waits for other work-items."""


def pocl_source(source: str) -> tuple[str, tuple[str, ...]]:
    """Return a source that PoCL compiles faster, and the options for it."""
    lists = {name: listed.replace("\\\n", "") for name, listed in _PARAMETER_LIST.findall(source)}
    source = _LANED_KERNEL.sub(partial(_as_function, lists), source)
    names = set(re.findall(r"\w+", source))
    declared = [line for name, line in _declarations() if name is None or name in names]
    options = (f"-D{HEADER_GUARD}",) if declared else ()
    return "\n".join([*declared, "#line 1", source]), options


def pocl_binary(binary: bytes) -> bytes:
    """Return a binary whose untranslated code PoCL does not find, in a folder of its own."""
    return _UNTRANSLATED_CODE.sub(rb"\1Z\2.no", binary, count=1)


def _as_function(lists: dict[str, str], kernel: re.Match[str]) -> str:
    """The kernel as a function and a kernel that calls it with the work-item's number."""
    name, arguments, code = kernel.groups()
    for macro, listed in lists.items():
        arguments = re.sub(rf"\b{macro}\b", listed, arguments)
    words = [argument.split() for argument in arguments.split(",")]
    if _PLACE_NAME.search(code) or min(map(len, words)) < 2:  # a macro of another name
        return kernel[0]
    values = ", ".join(argument[-1].lstrip("*") for argument in words)
    return (
        f"#define get_global_id(axis) work_item_\n"
        f"static ONCE void code_of_{name}({arguments}, const size_t work_item_)\n{code}\n"
        f"#undef get_global_id\n"
        f"LANED __kernel void {name}({arguments})\n"
        f"{{\n    code_of_{name}({values}, get_global_id(0));\n}}"
    )


@cache
def _declarations() -> list[tuple[str | None, str]]:
    """The lines of the file, and the function that each declares; [] if there is no such file."""
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
    # Without the guard, and without the types, which PoCL reads earlier.
    kernels = (
        line for line in lines if HEADER_GUARD not in line and not line.startswith("#include")
    )
    return [(_declares(line), line) for line in kernels]


def _declares(line: str) -> str | None:
    """The function that a line declares, if the declaration is complete."""
    if "__ovld" not in line or not line.endswith(";"):
        return None
    return line.partition("(")[0].split()[-1]
