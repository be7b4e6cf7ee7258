"""The record of a comparison: the command to repeat it, and everything its figures depend on."""

import json
import shlex
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tactograph.graph.compare.compare import Row, Study
from tactograph.graph.declare.provenance import versions
from tactograph.graph.disk.atomic_files import write_file
from tactograph.graph.disk.content_hash import content_hash
from tactograph.graph.files.dump_graph import dump_graph

RECORD_FILE = "report.json"


def make_record(study: Study, rows: Sequence[Row], argv: list[str]) -> dict[str, Any]:
    """Describe a finished comparison for ``report.json``."""
    return {
        "command": shlex.join(["tactograph", *argv]),
        "created": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "graphs": {graph.name: graph.hash for graph in study.graphs},
        "capture_hashes": {capture.name: content_hash(capture) for capture in study.captures},
        "devices_used": sorted({row.device for row in rows if row.device}),
        "sweeps": [sweep.text for sweep in study.sweeps],
        "seed": study.seed,
        "repeats": study.repeats,
        "versions": versions(),
    }


def write_record(record: Mapping[str, Any], study: Study, out: Path) -> None:
    """Write ``report.json``, and the resolved graphs beside it in ``graphs/``."""
    for graph in study.graphs:
        write_file(out / "graphs" / f"{graph.name}.yaml", dump_graph(graph))
    write_file(out / RECORD_FILE, json.dumps(record, indent=1) + "\n")
