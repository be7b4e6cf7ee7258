"""The notebook of the documentation runs, and prints what it shows."""

from pathlib import Path
from typing import Any

import pytest

from tests.fixtures import ROOT

nbformat = pytest.importorskip("nbformat", reason="'make test-all' installs it")
pytestmark = pytest.mark.slow


def printed(notebook: Any) -> list[str]:
    """The printed text of each cell.  Its split into outputs is only a matter of time: text that is
    printed within a fifth of a second is one output."""
    return [
        "".join(o["text"] for o in cell.get("outputs", []) if o["output_type"] == "stream")
        for cell in notebook.cells
    ]


def test_the_notebook_runs_and_prints_what_it_shows(tmp_path: Path) -> None:
    shown = nbformat.read(ROOT / "docs" / "notebook.ipynb", as_version=4)
    run = nbformat.read(ROOT / "docs" / "notebook.ipynb", as_version=4)
    where = {"metadata": {"path": str(tmp_path)}}
    from nbclient import NotebookClient

    NotebookClient(run, timeout=120, kernel_name="python3", resources=where).execute()
    assert printed(run) == printed(shown)
    pictures = [d for c in run.cells for o in c.get("outputs", []) for d in o.get("data", {})]
    assert {"text/html", "image/svg+xml"} <= {*pictures}


def test_the_printed_text_does_not_depend_on_its_timing() -> None:
    def notebook(*texts: str) -> Any:
        outputs = [nbformat.v4.new_output("stream", text=text) for text in texts]
        return nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(outputs=outputs)])

    assert printed(notebook("0.9\n1.0\n")) == printed(notebook("0.9\n", "1.0\n"))
