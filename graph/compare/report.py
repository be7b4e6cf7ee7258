"""The report of a comparison: its record, the graphs, and one self-contained page.

The record has the command to repeat it, and everything that the figures depend on.
"""

import json
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import resources
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jinja2 import Environment, StrictUndefined
from numpy.typing import NDArray

from tactograph.graph.compare.compare import Row, Study
from tactograph.graph.compare.differences import differences
from tactograph.graph.compare.stored_views import find_truth, load_views
from tactograph.graph.compare.sweep import Sweep
from tactograph.graph.compare.tables import (
    FIGURE_AIMS,
    Line,
    columns,
    fallback_lines,
    figure_cells,
    make_lines,
    over_all,
    row_labels,
    sweep_columns,
    what_is_better,
)
from tactograph.graph.declare.provenance import versions
from tactograph.graph.disk.atomic_files import write_file
from tactograph.graph.disk.content_hash import content_hash
from tactograph.graph.files.dump_graph import dump_graph
from tactograph.graph.show.figures import short, words
from tactograph.graph.show.pictures import (
    ERROR_PERCENTILE,
    Curve,
    draw_curves,
    draw_errors,
    draw_labels,
    draw_maps,
    draw_planes,
    draw_section,
)
from tactograph.graph.show.views import View
from tactograph.graph.show.warning_lines import warning_lines

RECORD_FILE, REPORT_FILE = "report.json", "report.html"
TRUTH_LABEL = "truth"
MAX_APART = 3
"""Largest number of differences within a box to list; of more, their number is shown."""
MAX_PANELS = 7
"""Largest number of runs of a capture to draw; of more, evenly spaced ones are drawn."""


@dataclass(frozen=True)
class Picture:
    """A drawing as a data URI, and the sentence under it."""

    uri: str
    caption: str


@dataclass(frozen=True)
class Section:
    """All pictures of one capture."""

    title: str
    omitted: int
    pictures: list[Picture]


def write_report(study: Study, rows: Sequence[Row], argv: list[str], out: Path) -> Path:
    """Write record, graphs and page into the folder of the runs; return the path of the page."""
    lines, record = make_lines(rows), _record(study, rows, argv)
    for graph in study.graphs:
        write_file(out / "graphs" / f"{graph.name}.yaml", dump_graph(graph))
    write_file(out / RECORD_FILE, json.dumps(record, indent=1) + "\n")
    source = resources.files("tactograph.graph.compare").joinpath("report.html.j2")
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    page = environment.from_string(source.read_text("utf-8")).render(
        title=", ".join(graph.name for graph in study.graphs),
        record=record,
        graphs=[_variant(graph, study) for graph in study.graphs],
        table=_table(lines),
        details=_table(lines, details=True) if columns(lines) != columns(lines, True) else None,
        curves=[picture for sweep in study.sweeps for picture in _curves(sweep, lines)],
        sections=_sections(rows, out),
        fallbacks=fallback_lines(rows),
        warnings=warning_lines(((line.label, line.warnings) for line in lines), None),
        repeats=study.repeats,
    )
    write_file(out / REPORT_FILE, page)
    return out / REPORT_FILE


def _record(study: Study, rows: Sequence[Row], argv: list[str]) -> dict[str, Any]:
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


def _variant(graph: Any, study: Study) -> dict[str, Any]:
    base = study.graphs[0]
    boxes = differences(base, graph)
    return {
        "name": graph.name,
        "title": graph.title,
        "hash": graph.hash,
        "is_base": graph is base,
        "differences": boxes,
        "few_differences": [name for name in boxes if len(boxes[name]) <= MAX_APART],
        "text": dump_graph(graph),
    }


def _table(lines: Sequence[Line], details: bool = False) -> dict[str, Any]:
    """Headings and cells, in blocks of one capture each."""
    rows = [*lines, *([] if details else over_all(lines))]
    names, targets = columns(lines, details), sweep_columns(lines)
    blocks: dict[str, list[dict[str, Any]]] = {}
    for line in rows:
        about = {"labels": row_labels(line, targets), "cells": figure_cells(line, names, rows)}
        about |= {"error": line.error, "warnings": line.warnings}
        blocks.setdefault(line.capture, []).append(about)
    headings = [
        {"text": words(name), "better": what_is_better(name), "aim": FIGURE_AIMS.get(name)}
        for name in names
    ]
    return {"labels": ["variant", *targets, "back end"], "headings": headings, "blocks": blocks}


def _label(variant: str, backend: str, sweep: Mapping[str, Any], lines: Iterable[Line]) -> str:
    """A run in a few words: those that distinguish it from other runs."""
    several = len({other.backend for other in lines}) > 1
    swept = [f"{target.rpartition('.')[2]} {short(v)}" for target, v in sweep.items()]
    return ", ".join([variant, *swept, *([backend] if several else [])])


def _curves(sweep: Sweep, lines: Sequence[Line]) -> list[Picture]:
    """A picture for each capture: every figure over the swept parameter."""
    pictures = []
    for capture in dict.fromkeys(line.capture for line in lines):
        of_capture = [line for line in lines if line.capture == capture]
        figures = {name: _curves_of(name, sweep, of_capture) for name in columns(of_capture)}
        figures = {name: curves for name, curves in figures.items() if _varies(curves)}
        if figures:
            on = f" on {capture}" if capture else ""
            caption = f"{sweep.target}{on}. Dashed: variants that do not have the parameter."
            uri = draw_curves(figures, sweep.target, sweep.log)
            pictures.append(Picture(uri, caption))
    return pictures


def _curves_of(name: str, sweep: Sweep, lines: Sequence[Line]) -> dict[str, Curve]:
    """The curves of one figure, labelled by variant, back end and other swept values."""
    curves: dict[str, tuple[list[Any], list[Any]]] = {}
    for line in lines:
        if name not in line.figures:
            continue
        rest = {target: v for target, v in line.sweep.items() if target != sweep.target}
        label = _label(line.variant, line.backend, rest, lines)
        values, estimates = curves.setdefault(label, ([], []))
        estimates.append(line.figures[name])
        if sweep.target in line.sweep:
            values.append(line.sweep[sweep.target])
    return dict(curves)


def _varies(curves: Mapping[str, Curve]) -> bool:
    return len({f"{e.mean:.6g}" for _, estimates in curves.values() for e in estimates}) > 1


def _sections(rows: Sequence[Row], out: Path) -> list[Section]:
    """The pictures of each capture, of the first seed of each run."""
    lines = make_lines(rows)
    whole = [row for row in rows if not row.error]
    sections = []
    for capture in dict.fromkeys(row.capture for row in whole):
        first: dict[str, Row] = {}
        for row in whole:
            if row.capture == capture:
                first.setdefault(_label(row.variant, row.backend, row.sweep, lines), row)
        drawn = dict(_thinned(list(first.items())))
        views = {label: load_views(row.folder(out)) for label, row in drawn.items()}
        pictures = _pictures({label: view for label, view in views.items() if view})
        sections.append(Section(capture, len(first) - len(drawn), pictures))
    return sections


def _thinned(items: list[Any]) -> list[Any]:
    if len(items) <= MAX_PANELS:
        return items
    chosen = np.linspace(0, len(items) - 1, MAX_PANELS).round().astype(int)
    return [items[i] for i in chosen]


def _pictures(runs: Mapping[str, Mapping[str, View]]) -> list[Picture]:
    """The drawings of one capture; `runs` holds the views of each run by its label."""
    pictures: list[Picture] = []
    names = dict.fromkeys(name for views in runs.values() for name in views)
    kinds = {name: next(v[name] for v in runs.values() if name in v) for name in names}
    for kind, name in product(("planes", "labels", "map"), kinds):
        view = kinds[name]
        if view.kind == kind and not view.is_truth:
            pictures += _DRAW_BY_KIND[kind](view, _panels(name, runs))
    return pictures


class _Panels(NamedTuple):
    """A view of all runs, all its truths and these runs, and the runs' errors, by panel."""

    results: dict[str, NDArray[Any]]
    panels: dict[str, NDArray[Any]]
    errors: dict[str, NDArray[Any]]


def _panels(name: str, runs: Mapping[str, Mapping[str, View]]) -> _Panels:
    """A view of all runs; runs that are equal in it and in its truth are one panel.

    The truth differs between runs of a swept scene.
    """
    by_label = {label: views[name] for label, views in runs.items() if name in views}
    shape = next(iter(by_label.values())).array.shape
    equal: dict[tuple[bytes, bytes], list[str]] = {}
    truths: dict[str, NDArray[Any]] = {}
    for label, view in by_label.items():
        if view.array.shape == shape:
            if truth := find_truth(view, runs[label]):
                truths[label] = truth.array
            key = view.array.tobytes(), truth.array.tobytes() if truth else b""
            equal.setdefault(key, []).append(label)
    labels = {_panel(alike): alike[0] for alike in equal.values()}
    results = {panel: by_label[label].array for panel, label in labels.items()}
    due = {panel: truths[label] for panel, label in labels.items() if label in truths}
    distinct = _distinct(due)
    titles = [TRUTH_LABEL] if len(distinct) == 1 else [f"{TRUTH_LABEL}, {k}" for k in distinct]
    drawn = dict(zip(titles, distinct.values(), strict=True))
    errors = {panel: results[panel] - truth for panel, truth in due.items()}
    return _Panels(results, {**drawn, **results}, errors)


def _panel(labels: Sequence[str]) -> str:
    """The title of a panel for equal runs."""
    return labels[0] if len(labels) == 1 else f"{labels[0]}; {len(labels) - 1} equal"


def _distinct(arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """The arrays without those that equal an earlier one."""
    distinct: dict[bytes, tuple[str, NDArray[Any]]] = {}
    for label, array in arrays.items():
        distinct.setdefault(array.tobytes(), (label, array))
    return dict(distinct.values())


def _draw_planes(view: View, about: _Panels) -> list[Picture]:
    name, distinct = words(view.name).capitalize(), _distinct(about.results)
    source = "given to every run" if len(distinct) == 1 else f"of {next(iter(distinct))}"
    return [Picture(draw_planes(view), f"{name}, {source}.")]


def _draw_labels(view: View, about: _Panels) -> list[Picture]:
    if not any(panel.any() for panel in about.panels.values()):
        return []
    name = words(view.name).capitalize()
    caption = f"{name}: a colour for each of the {view.unit}, dark where several are set."
    return [Picture(draw_labels(about.panels, view.unit), caption)]


def _draw_map(view: View, about: _Panels) -> list[Picture]:
    name, panels = words(view.name), about.panels
    finite = [panel for panel in panels.values() if np.isfinite(panel).any()]
    if not finite:
        return []
    axis = f"{name} / {view.unit}"
    pictures = [Picture(draw_maps(panels, axis), f"{name.capitalize()}, one scale for all.")]
    if about.errors:
        uri, end = draw_errors(about.errors, f"error / {view.unit}")
        caption = (
            f"Error of the {name}, one scale for all; it ends at ±{end:.3g} {view.unit}, which "
            f"{ERROR_PERCENTILE:g} % of the pixels do not reach. Red is too high, blue too low."
        )
        pictures.append(Picture(uri, caption))
    reference = np.where(np.isfinite(finite[0]), finite[0], np.nan)
    row = int(np.unravel_index(int(np.nanargmax(reference)), reference.shape)[0])
    uri = draw_section(panels, axis, row, TRUTH_LABEL if TRUTH_LABEL in panels else None)
    pictures.append(Picture(uri, f"Section through the peak, row {row}."))
    return pictures


_DRAW_BY_KIND = {"planes": _draw_planes, "labels": _draw_labels, "map": _draw_map}
