"""What is to be done with every capture of a batch."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True)
class Job:
    """Everything that decides what a capture gives.

    `graph` is the text of the flat graph file; `param` the graph's parameter that takes a
    capture; `folders` where results go as folders, None if maps go into the store; `code`,
    `versions` and `computes_on`, the device, are those of `Origin`.
    """

    graph: str
    name: str
    hash: str
    given: dict[str, Any]
    inputs: dict[str, str]
    param: str
    maps: tuple[str, ...]
    backend: str | None = None
    device: str | None = None
    strict: bool = False
    folders: str | None = None
    code: dict[str, str] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    computes_on: str = ""

    @property
    def identity(self) -> dict[str, Any]:
        """What must not change between the parts of one store."""
        same = (
            "hash", "given", "inputs", "param", "maps", "backend", "folders", "code", "versions",
            "computes_on",
        )  # fmt: skip
        return {name: value for name, value in asdict(self).items() if name in same}
