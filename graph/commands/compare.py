"""``tactograph compare``: variants side by side."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tactograph.graph.backends import BACKENDS
from tactograph.graph.commands import FOLDER_PATH, GraphName, device_option, say, with_option
from tactograph.graph.commands.progress_line import ProgressLine
from tactograph.graph.errors import InputError

if TYPE_CHECKING:
    from tactograph.graph.compare.compare import Row, Study


@click.command("compare", short_help="Run variants side by side, into tables and a report.")
@click.argument(
    "words", nargs=-1, metavar="GRAPH|STUDY... [NAME=VALUE]...", type=GraphName(studies=True)
)
@click.option(
    "--over", multiple=True, metavar="DIR",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="A capture folder, or a folder of them.",
)  # fmt: skip
@with_option
@click.option("--backends", metavar="LIST", help="Such as numpy,opencl; default: as preferred.")
@device_option
@click.option(
    "--sweep", "sweeps", multiple=True, metavar="NODE.PARAM=VALUES",
    help="Try values, FROM..TO:COUNT: 0.01..0.2:10, log:0.01..1:5; or a,b,c.  "
    "Several sweeps make a grid.",
)  # fmt: skip
@click.option("--seed", metavar="NODE.PARAM", help="The seed that repeats count up.")
@click.option(
    "--repeats", type=click.IntRange(1), default=1, show_default=True,
    help="Runs with different seeds, for 95 % confidence intervals.",
)  # fmt: skip
@click.option(
    "--columns", metavar="LIST",
    help="Figures to print, and for table.md and .tex, such as height_rmse_um,ms; default: all.",
)  # fmt: skip
@click.option(
    "--out", type=FOLDER_PATH, default="report", show_default=True,
    help="Folder for results, tables and report.",
)  # fmt: skip
def command(
    words: tuple[str, ...],
    *,
    over: Sequence[Path],
    overlays: Sequence[str],
    backends: str | None,
    device: str | None,
    sweeps: Sequence[str],
    seed: str | None,
    repeats: int,
    columns: str | None,
    out: Path,
) -> None:
    """Run every GRAPH on every capture on every back end; of a STUDY, its base and variants.

    NAME=VALUE and --with apply to every graph.  Folders among the words, as a shell expands DIR/*,
    are further captures.  Runs that were finished earlier are not repeated.  If a run fails, the
    others go on, and the exit code is 1.
    """
    from tactograph.graph.compare.compare import Study
    from tactograph.graph.compare.sweep import read_sweep
    from tactograph.graph.files.flat_graph import Graph
    from tactograph.graph.files.read_graph import read_graphs, with_overlays
    from tactograph.graph.run.open_pipeline import refuse_to_write_over

    others = [word for word in words if "=" not in word]
    folders = [*over, *(Path(word) for word in others if Path(word).is_dir())]
    names = [word for word in others if not Path(word).is_dir()]
    if not names:
        raise InputError(
            "compare needs at least one graph; 'tactograph graphs' lists those that ship"
        )
    captures = [capture for folder in folders for capture in Graph.captures_in(folder)]
    refuse_to_write_over(f"--out {out}", out, {f"--over {p}": p for p in (*folders, *captures)})
    graphs = [with_overlays(graph, overlays) for name in names for graph in read_graphs(name)]
    study = Study(
        graphs=graphs,
        values=[word for word in words if "=" in word],
        captures=captures,
        backends=_read_backends(backends),
        device=device,
        sweeps=[read_sweep(word) for word in sweeps],
        seed=seed,
        repeats=repeats,
    )
    _compare(study, out, columns)


def _read_backends(text: str | None) -> list[str | None]:
    if not text:
        return [None]
    names = text.split(",")
    if not {*names} <= {*BACKENDS}:
        raise InputError(f"--backends {text}: there are {', '.join(BACKENDS)}")
    return [*names]


def _compare(study: Study, out: Path, columns: str | None) -> None:
    from tactograph.graph.extras import need

    need("report", "the report of a comparison", "jinja2")
    from tactograph.graph.compare.report import write_report
    from tactograph.graph.compare.tables import print_table, write_tables

    study.check()
    rows = _run_all(study, out)
    wanted = columns.split(",") if columns else []
    write_tables(rows, out, wanted)
    page = write_report(study, rows, sys.argv[1:], out)
    width = shutil.get_terminal_size((160, 24)).columns
    print_table(rows, say, width, wanted)
    say(f"tables: {out / 'table.csv'}, .json, .md, .tex; report: {page}")
    if all(row.error for row in rows):
        raise InputError("every run failed; the reasons are above")
    if any(row.error for row in rows):
        raise SystemExit(1)


def _run_all(study: Study, out: Path) -> list[Row]:
    from tactograph.graph.cache.cache import Cache
    from tactograph.graph.compare.compare import make_jobs, run_job

    cache = Cache()
    jobs = make_jobs(study)
    rows: list[Row] = []
    recalled = 0
    with ProgressLine() as line:
        for number, job in enumerate(jobs):
            line.at(f"{job.row.label}, {number + 1} of {len(jobs)} runs", number / len(jobs))
            row, was_there = run_job(job, study, out, cache)
            if row.error:
                line.say(f"failed: {job.row.label}", err=True)
            rows.append(row)
            recalled += was_there
    if recalled:
        say(f"{recalled} of {len(jobs)} runs were there already", err=True)
    return rows
