"""The notebook of the documentation runs, and says what it says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

from tests.conftest import ROOT


def printed(notebook: Any) -> list[str]:
    return [
        output["text"]
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if output["output_type"] == "stream"
    ]


def test_the_notebook_runs_and_prints_what_it_shows(tmp_path: Path) -> None:
    shown = nbformat.read(ROOT / "docs" / "notebook.ipynb", as_version=4)
    run = nbformat.read(ROOT / "docs" / "notebook.ipynb", as_version=4)
    where = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(run, timeout=120, kernel_name="python3", resources=where).execute()
    assert printed(run) == printed(shown)
    pictures = [d for c in run.cells for o in c.get("outputs", []) for d in o.get("data", {})]
    assert {"text/html", "image/svg+xml"} <= {*pictures}
