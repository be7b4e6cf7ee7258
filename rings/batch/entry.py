"""The result of one capture."""

import json
import zlib
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

PENDING, DONE, FAILED = 0, 1, 2
STATUS_NAMES = ("pending", "done", "failed")


@dataclass
class Entry:
    """The status, figures, warnings and maps of one capture."""

    status: int
    reason: str = ""
    figures: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    milliseconds: float = float("nan")
    maps: dict[str, NDArray[Any]] = field(default_factory=dict)

    @property
    def checksum(self) -> int:
        """CRC-32 of the figures and of the maps in order of name."""
        crc = zlib.crc32(json.dumps(self.figures).encode())
        for name in sorted(self.maps):
            crc = zlib.crc32(self.maps[name].tobytes(), crc)
        return crc


def read_figures(text: str) -> dict[str, float]:
    """Read figures that were written as JSON; damaged ones count as none."""
    try:
        return dict(json.loads(text or "{}"))
    except (ValueError, TypeError, RecursionError):
        return {}
