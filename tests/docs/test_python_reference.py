"""The page of the Python interface names every public name, and nothing else."""

import ast
import inspect
import re
from dataclasses import fields

import pytest

import tactograph.graph
from tactograph.graph import Pipeline, load
from tactograph.graph.plan.plan import Plan
from tactograph.graph.run.result import Result
from tests.fixtures import ROOT

PAGE = (ROOT / "docs" / "python_reference.md").read_text(encoding="utf-8")
NAMED = {word for code in re.findall(r"`([^`]+)`", PAGE) for word in re.findall(r"[\w.]+", code)}


def public(kind: type) -> set[str]:
    return {name for name in vars(kind) if not name.startswith("_")}


def handed_on() -> set[str]:
    """The names that the engine imports as themselves, for others."""
    tree = ast.parse(inspect.getsource(tactograph.graph))
    imports = [each for each in ast.walk(tree) if isinstance(each, ast.ImportFrom)]
    return {alias.asname for each in imports for alias in each.names if alias.asname}


def test_every_name_of_the_engine_a_pipeline_and_a_result_is_on_the_page() -> None:
    assert {"load", "node"} <= handed_on() <= NAMED
    assert {f"pipeline.{name}" for name in public(Pipeline)} <= NAMED
    assert {f"out.{field.name}" for field in fields(Result)} <= NAMED
    rows = re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE)
    assert set(inspect.signature(load).parameters) <= set(rows)


@pytest.mark.parametrize(
    ("prefix", "names"),
    [
        ("pipeline", public(Pipeline) | {"plan"}),
        ("out", {field.name for field in fields(Result)}),
        ("plan", {field.name for field in fields(Plan)} | public(Plan)),
    ],
)
def test_every_name_on_the_page_exists(prefix: str, names: set[str]) -> None:
    named = {name.split(".")[1] for name in NAMED if name.startswith(f"{prefix}.")}
    assert named
    assert named <= names
