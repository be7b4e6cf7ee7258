"""Hashes of the content of files and folders, and of plain data."""

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any


def content_hash(path: Path) -> str:
    """SHA-256 (first 16 digits) of a file, or of the files of a folder with their names."""
    files = sorted(f for f in path.rglob("*") if f.is_file()) if path.is_dir() else [path]
    try:
        stats = [(file, file.stat()) for file in files]
    except OSError:  # the run itself reports it
        return ""
    return _content_hash(path, tuple((f, stat.st_size, stat.st_mtime_ns) for f, stat in stats))


@cache
def _content_hash(path: Path, files: tuple[tuple[Path, int, int], ...]) -> str:
    digest = hashlib.sha256()
    for file, size, _ in files:
        digest.update(f"{file.relative_to(path)}:{size}:".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def digest(about: Mapping[str, Any]) -> str:
    """SHA-256 (first 16 digits) of plain data."""
    text = json.dumps(about, sort_keys=True, separators=(",", ":"), default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
