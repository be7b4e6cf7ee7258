"""The record of a comparison, from which it can be made again."""

import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from tactograph.graph.cache.result_origin import find_origin
from tactograph.graph.compare.compare import Row, Study
from tactograph.graph.compare.sweep import read_sweep
from tactograph.graph.declare.provenance import versions
from tactograph.graph.disk.atomic_files import atomic_file
from tactograph.graph.disk.content_hash import content_hash
from tactograph.graph.errors import InputError, TactographError
from tactograph.graph.files.dump_graph import dump_graph
from tactograph.graph.files.read_graph import read_graph

RECORD_FILE = "report.json"
RECORD_FORMAT = 1


@dataclass
class Record:
    """The contents of ``report.json``; the resolved graphs lie beside it in ``graphs/``."""

    command: str
    made: str
    graphs: dict[str, str]
    values: list[str]
    captures: list[str]
    capture_hashes: dict[str, str]
    backends: list[str | None]
    device: str | None
    devices_used: list[str]
    sweeps: list[str]
    seed: str | None
    repeats: int
    versions: dict[str, str] = field(default_factory=versions)
    code: dict[str, str] = field(default_factory=dict)
    format: int = RECORD_FORMAT


def make_record(study: Study, rows: Sequence[Row], argv: list[str]) -> Record:
    """Describe a comparison that has been run."""
    return Record(
        command=shlex.join(["tactograph", *argv]),
        made=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        graphs={graph.name: graph.hash for graph in study.graphs},
        values=_absolute(study),
        captures=[str(capture.resolve()) for capture in study.captures],
        capture_hashes={capture.name: content_hash(capture) for capture in study.captures},
        backends=list(study.backends),
        device=study.device,
        devices_used=sorted({row.device for row in rows if row.device}),
        sweeps=[sweep.text for sweep in study.sweeps],
        seed=study.seed,
        repeats=study.repeats,
        code=_code(study),
    )


def _code(study: Study) -> dict[str, str]:
    """The hash of the code of every node of the study's graphs that can be found."""
    code: dict[str, str] = {}
    for graph in study.graphs:
        with suppress(TactographError):  # a row of the table says what is wrong
            code |= find_origin(graph, backend="numpy", device=None).code
    return code


def write_record(record: Record, study: Study, out: Path) -> None:
    """Write ``report.json`` and the resolved graphs."""
    for graph in study.graphs:
        with atomic_file(out / "graphs" / f"{graph.name}.yaml") as file:
            file.write_text(dump_graph(graph))
    with atomic_file(out / RECORD_FILE) as file:
        file.write_text(json.dumps(asdict(record), indent=1) + "\n")


def read_record(folder: Path) -> Record:
    """Read what `write_record` wrote.  Raises InputError if there is none, or it is damaged."""
    file = folder / RECORD_FILE
    with _reading(file):
        record = Record(**json.loads(file.read_text()))
    if record.format != RECORD_FORMAT:
        raise InputError(f"{file}: format {record.format}; this version reads {RECORD_FORMAT}")
    return record


def read_rows(folder: Path) -> list[Row]:
    """Read the runs in ``table.json``.  Raises InputError if there is none, or it is damaged."""
    file = folder / "table.json"
    with _reading(file):
        return [Row(**row) for row in json.loads(file.read_text())]


@contextmanager
def _reading(file: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{file}: {error.strerror or error}; --again wants a report's folder"
        ) from None
    except (ValueError, TypeError):
        raise InputError(f"{file}: damaged, or from another version") from None


def study_again(record: Record, folder: Path) -> Study:
    """The study that a record describes.

    Raises InputError if a graph is missing or was changed, or a capture has gone.
    """
    graphs = []
    for name, recorded in record.graphs.items():
        file = folder / "graphs" / f"{name}.yaml"
        graph = read_graph(str(file))
        if graph.hash != recorded:
            raise InputError(f"{file}: was changed since (hash {graph.hash}, then {recorded})")
        graphs.append(graph)
    gone = [capture for capture in record.captures if not Path(capture).is_dir()]
    if gone:
        raise InputError(f"{gone[0]}: the capture is no longer there")
    return Study(
        graphs=graphs,
        values=record.values,
        captures=[Path(capture) for capture in record.captures],
        backends=record.backends,
        device=record.device,
        sweeps=[read_sweep(text) for text in record.sweeps],
        seed=record.seed,
        repeats=record.repeats,
    )


def what_changed(then: Record, now: Record) -> list[str]:
    """Versions, code, captures and devices that have changed, in words."""
    pairs = [
        *_pairs(then.versions, now.versions),
        *((f"code of {n}", a, b) for n, a, b in _pairs(then.code, now.code)),
        *((f"capture {n}", a, b) for n, a, b in _pairs(then.capture_hashes, now.capture_hashes)),
        ("device", ", ".join(then.devices_used), ", ".join(now.devices_used)),
    ]
    return [
        f"{name} was {old or 'absent'}, is {new or 'absent'}"
        for name, old, new in pairs
        if old != new
    ]


def deviation(then: Sequence[Row], now: Sequence[Row]) -> str:
    """Describe how far the figures of a repeated comparison are from the former ones."""
    former = {row.key: row.figures for row in then}
    count, worst, where = 0, 0.0, ""
    for row in now:
        for name in row.figures.keys() & former.get(row.key, {}).keys():
            before, figure = former[row.key][name], row.figures[name]
            apart = abs(figure - before) / max(abs(before), abs(figure), 1e-12)
            count += 1
            if apart > worst:
                worst, where = apart, f"{name} of {row.variant}: {before:.6g}, now {figure:.6g}"
    if worst == 0:
        return f"all {count} figures are the same as before"
    return f"of {count} figures the largest change is {100 * worst:.2g} % ({where})"


def _pairs(then: Mapping[str, str], now: Mapping[str, str]) -> list[tuple[str, str, str]]:
    return [(n, then.get(n, ""), now.get(n, "")) for n in dict.fromkeys([*then, *now])]


def _absolute(study: Study) -> list[str]:
    """The ``name=value`` words with paths that hold from any folder."""
    words = []
    for word in study.values:
        name, _, text = word.partition("=")
        is_path = any(g.params[name].kind == "path" for g in study.graphs if name in g.params)
        words.append(f"{name}={Path(text).resolve()}" if is_path else word)
    return words
