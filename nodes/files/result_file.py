"""``result.json``: its statements about the files beside it."""

import json
import zlib
from pathlib import Path
from typing import Any

from tactograph.graph import InputError

RESULT_FILE = "result.json"
RELIEF_FIGURE = "rest_relief_mm"
"""The figure of a touch whose film is no plane at rest (`measure_contact`)."""


def read_result(folder: Path) -> dict[str, Any]:
    """Return the content of a folder's ``result.json``; empty if there is none that can be read."""
    try:
        result = json.loads((folder / RESULT_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return result if isinstance(result, dict) else {}


def checksum(file: Path) -> str:
    """Return the CRC-32 of a file, as eight hexadecimal digits."""
    return f"{zlib.crc32(file.read_bytes()):08x}"


def refuse_changed(file: Path) -> None:
    """Refuse a file that a result beside it names, if it is not the one that was written with it.

    Raises
    ------
    InputError
        If it is another: a kill left some files old and some new, or it was changed since.
    """
    checksums = read_result(file.parent).get("checksums")
    stated = checksums.get(file.name) if isinstance(checksums, dict) else None
    if stated is not None and stated != checksum(file):
        raise InputError(
            f"{file}: is not what {RESULT_FILE} beside it was written with: the write was cut off, "
            "or it was changed since; reconstruct again, or copy it to another folder"
        )
