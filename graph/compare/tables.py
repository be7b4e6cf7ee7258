"""The figures of a comparison as tables: for programs, for papers and for the terminal."""

import csv
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import fmean
from typing import Any

from tactograph.graph.compare.compare import Row
from tactograph.graph.disk.atomic_files import atomic_files
from tactograph.graph.errors import InputError, did_you_mean
from tactograph.graph.show.figures import Estimate, estimate, short, words
from tactograph.graph.show.text_table import fitting_table
from tactograph.graph.show.warning_lines import warning_lines

HIGHER_IS_BETTER = frozenset({"iou", "precision", "recall", "accuracy"})
"""Words in the names of such figures; any other figure is best when nearest to its aim."""
FIGURE_AIMS = {"in_90_percent_band": 90, "stated_over_actual": 1}
"""Figures whose ideal value is not zero."""
DESCRIPTIVE_FIGURES = ("contact", "peak_px", "trust", "check_", "rim_share")
"""Beginnings of names of descriptive figures, which have no better or worse values.  Trust
depends on the checks that a graph makes: a graph that checks less trusts more."""
TIME_FIGURE = "ms"
BEST_MARK = "*"
"""Marks the best figure on the terminal."""


@dataclass(frozen=True)
class Line:
    """A line of the table: the runs that differ only in their seed."""

    variant: str
    capture: str
    backend: str
    sweep: Mapping[str, Any]
    rows: Sequence[Row]
    figures: Mapping[str, Estimate]

    @property
    def error(self) -> str:
        return next((row.error for row in self.rows if row.error), "")

    @property
    def warnings(self) -> list[str]:
        return list(dict.fromkeys(text for row in self.rows for text in row.warnings))

    @property
    def label(self) -> str:
        """The run in words."""
        swept = "".join(f" {target}={value}" for target, value in self.sweep.items())
        return f"{self.variant} on {self.capture or 'its own data'}{swept}"

    @property
    def hash(self) -> str:
        return self.rows[0].hash

    @property
    def where(self) -> str:
        """The back ends that were used."""
        used = {backend for row in self.rows for backend in row.backends.values()}
        return " + ".join(sorted(used)) or self.backend


def make_lines(rows: Iterable[Row]) -> list[Line]:
    """Put the runs that differ only in their seed into one line each, in order."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(row.key[:-1], []).append(row)
    return [_line(group) for group in groups.values()]


def over_all(lines: Sequence[Line]) -> list[Line]:
    """The means over all captures, if there are several, as a paper states them.

    Signed errors do not cancel: their absolute values are averaged, and the mean is labelled so.
    """
    if len({line.capture for line in lines}) < 2:
        return []
    groups: dict[tuple[str, ...], list[Line]] = {}
    for line in lines:
        groups.setdefault((line.variant, line.backend, repr(line.sweep)), []).append(line)
    whole = [g for g in groups.values() if len(g) > 1 and not any(line.error for line in g)]
    figures = ((name, x.figures.get(name)) for g in whole for x in g for name in columns(g))
    signed = any(each is not None and _size(name, each.mean) != each.mean for name, each in figures)
    return [_mean_line(group, ", signs left out" if signed else "") for group in whole]


def columns(lines: Iterable[Line], details: bool = False) -> list[str]:
    """The names of the figures.  One with a slash, ``iou/led1``, is a detail of another."""
    names = dict.fromkeys(name for line in lines for name in line.figures)
    return [name for name in names if details or "/" not in name]


def sweep_columns(lines: Iterable[Line]) -> list[str]:
    return list(dict.fromkeys(target for line in lines for target in line.sweep))


def what_is_better(name: str) -> str:
    """Return "higher", or "nearer to" a number; empty if the figure is not judged."""
    if name.startswith(DESCRIPTIVE_FIGURES):
        return ""
    return "higher" if _is_higher_better(name) else f"nearer to {FIGURE_AIMS.get(name, 'zero')}"


def is_best(line: Line, name: str, lines: Iterable[Line]) -> bool:
    """Return whether no line of the same capture has a better figure, and some have a worse one.

    The time of a single run is never the best, since it varies from run to run.
    """
    if name not in line.figures or not what_is_better(name):
        return False
    peers = [x.figures[name] for x in lines if x.capture == line.capture and name in x.figures]
    if name == TIME_FIGURE and any(peer.count < 2 for peer in peers):
        return False
    costs = [_cost(name, peer.mean) for peer in peers]
    return _cost(name, line.figures[name].mean) == min(costs) < max(costs)


def _is_higher_better(name: str) -> bool:
    return not HIGHER_IS_BETTER.isdisjoint(name.partition("/")[0].split("_"))


def _cost(name: str, value: float) -> float:
    return -value if _is_higher_better(name) else abs(value - FIGURE_AIMS.get(name, 0))


def _size(name: str, value: float) -> float:
    """A figure for averaging: an error counts without its sign."""
    return abs(value) if what_is_better(name) == "nearer to zero" else value


def write_tables(rows: Sequence[Row], out: Path, wanted: Sequence[str] = ()) -> None:
    """Write ``table.csv``, ``table.json`` (every single run), ``table.md`` and ``table.tex``.

    The last two, which papers include, hold the `wanted` figures, or all.
    """
    lines = make_lines(rows)
    names = wanted or columns(lines)
    with atomic_files(out) as stage:
        _write_csv(lines, stage / "table.csv")
        text = json.dumps([asdict(row) for row in rows], indent=1)
        (stage / "table.json").write_text(text + "\n")
        (stage / "table.md").write_text(_markdown(lines, names))
        (stage / "table.tex").write_text(_latex(lines, names))


def read_rows(out: Path) -> list[Row]:
    """Read the runs that `write_tables` wrote into ``table.json``."""
    return [Row(**row) for row in json.loads((out / "table.json").read_text())]


def print_table(
    rows: Sequence[Row], echo: Callable[[str], None], width: int, wanted: Sequence[str] = ()
) -> None:
    """Print the `wanted` figures, or all; a star marks the best value of each capture.

    Raises InputError if a wanted figure does not exist.
    """
    lines = make_lines(rows)
    names = _chosen(lines, wanted) if wanted else columns(lines)
    headings, labels, table = _cells(lines, names, f"{{}}{BEST_MARK}", "{} ")
    echo(fitting_table(headings, table, labels, width))
    if any(cell.endswith(BEST_MARK) for cells in table for cell in cells):
        echo(f"{BEST_MARK} best of its capture: {_what_is_best(names)}")
    failed = ((line.label, [line.error]) for line in lines if line.error)
    for text in warning_lines(failed, None):
        echo(text.replace("warning", "failed", 1))
    if warned := sum(bool(line.warnings) for line in lines):
        echo(f"{warned} of {len(lines)} with warnings")
    for text in warning_lines((line.label, line.warnings) for line in lines):
        echo(text)
    for text in fallback_lines(rows):
        echo(f"fallback: {text}")


def _chosen(lines: Sequence[Line], wanted: Sequence[str]) -> list[str]:
    names = columns(lines, details=True)
    for name in wanted:
        if name not in names:
            raise InputError(f"--columns: there is no figure '{name}'{did_you_mean(name, names)}")
    return [*wanted]


def _what_is_best(names: Iterable[str]) -> str:
    highest = [words(name) for name in names if what_is_better(name) == "higher"]
    aimed = [f"{words(n)} nearest to {FIGURE_AIMS[n]}" for n in names if n in FIGURE_AIMS]
    parts = [*([f"highest {', '.join(highest)}"] if highest else []), *aimed]
    return "; ".join([*parts, "else nearest to zero" if parts else "nearest to zero"])


def fallback_lines(rows: Iterable[Row]) -> list[str]:
    """Each fallback once, behind the names of its graphs."""
    variants: dict[str, dict[str, None]] = {}
    for row in rows:
        for text in row.fallbacks:
            variants.setdefault(text, {})[row.variant] = None
    return [f"{', '.join(names)}: {text}" for text, names in variants.items()]


def _line(rows: Sequence[Row]) -> Line:
    good = [row for row in rows if not row.error]
    names = dict.fromkeys(name for row in good for name in row.figures)
    figures = {n: estimate([r.figures[n] for r in good if n in r.figures]) for n in names}
    timed = [sum(row.milliseconds.values()) for row in good if row.milliseconds]
    if timed:
        figures[TIME_FIGURE] = estimate(timed)
    first = rows[0]
    return Line(first.variant, first.capture, first.backend, first.sweep, rows, figures)


def _mean_line(lines: Sequence[Line], remark: str) -> Line:
    """A plain mean: captures are not repeats, so an interval would be meaningless."""
    first = lines[0]
    names = [name for name in first.figures if all(name in line.figures for line in lines)]
    means = {n: fmean(_size(n, line.figures[n].mean) for line in lines) for n in names}
    figures = {name: Estimate(mean, mean, mean, 1) for name, mean in means.items()}
    title = f"mean of {len(lines)} captures{remark}"
    rows = [row for line in lines for row in line.rows]
    return Line(first.variant, title, first.backend, first.sweep, rows, figures)


def row_labels(line: Line, targets: Iterable[str]) -> list[str]:
    """Variant, swept values and back ends of a line."""
    return [line.variant, *(short(line.sweep.get(target, "")) for target in targets), line.where]


def figure_cells(line: Line, names: Iterable[str], peers: Sequence[Line]) -> list[tuple[str, bool]]:
    """The figures of a line as text, and whether each is the best of its capture."""
    return [(str(line.figures.get(name, "")), is_best(line, name, peers)) for name in names]


def _cells(
    lines: Sequence[Line], names: Sequence[str], best: str, other: str = "{}"
) -> tuple[list[str], int, list[list[str]]]:
    """Headings, how many of them are labels, and rows; figures in the form of the best or other."""
    shown, targets = [*lines, *over_all(lines)], sweep_columns(lines)
    by_capture = any(line.capture for line in lines)
    labels = [*["capture"] * by_capture, "variant", *targets, "back end"]
    rows = []
    for line in shown:
        figures = figure_cells(line, names, shown)
        cells = [(best if leads else other).format(text) if text else "" for text, leads in figures]
        rows.append([*[line.capture] * by_capture, *row_labels(line, targets), *cells])
    return [*labels, *map(words, names)], len(labels), rows


def _write_csv(lines: Sequence[Line], file: Path) -> None:
    names, targets = columns(lines, details=True), sweep_columns(lines)
    several, rows = any(len(line.rows) > 1 for line in lines), list[dict[str, Any]]()
    for line in lines:
        row = dict[str, Any](variant=line.variant, capture=line.capture, backend=line.backend)
        row |= {target: line.sweep.get(target, "") for target in targets}
        figures = {name: line.figures.get(name) for name in names}
        row |= {name: "" if f is None else f.mean for name, f in figures.items()}
        if several:
            row["runs"] = len(line.rows)
            for name, f in figures.items():
                row[f"{name}_low"], row[f"{name}_high"] = ("", "") if f is None else (f.low, f.high)
        row |= {"hash": line.hash, "warnings": "; ".join(line.warnings), "error": line.error}
        rows.append(row)
    with file.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0])
        writer.writeheader()
        writer.writerows(rows)


def _markdown(lines: Sequence[Line], names: Sequence[str]) -> str:
    headings, labels, rows = _cells(lines, names, "**{}**")
    rule = ["---" if number < labels else "---:" for number in range(len(headings))]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in (headings, rule, *rows))


def _latex(lines: Sequence[Line], names: Sequence[str]) -> str:
    """A table for the booktabs package, a block for each capture."""
    headings, labels, rows = _cells(lines, names, r"\textbf{{{}}}")
    form = "l" * labels + "r" * (len(headings) - labels)
    text = [f"\\begin{{tabular}}{{{form}}}", r"\toprule", _latex_row(map(_escaped, headings))]
    capture = None
    for row in rows:
        here = row[0] if any(line.capture for line in lines) else ""
        if here != capture:
            text.append(r"\midrule")
            capture = here
        figures = [cell.replace("±", r"$\pm$") for cell in row[labels:]]
        text.append(_latex_row([*map(_escaped, row[:labels]), *figures]))
    text += [r"\bottomrule", r"\end{tabular}"]
    return "% \\usepackage{booktabs}\n" + "\n".join(text) + "\n"


def _latex_row(cells: Iterable[str]) -> str:
    return " & ".join(cells) + r" \\"


def _escaped(text: str) -> str:
    """Text with LaTeX's special characters escaped."""
    return "".join(f"\\{c}" if c in "&%$#_{}" else c for c in text.replace("\\", "/"))
