"""Pictures of a plan: DOT, Mermaid and SVG."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.files.read_graph import read_graph, shipped_names
from tactograph.graph.plan.draw import edges, to_dot, to_mermaid
from tactograph.graph.plan.draw_svg import to_svg
from tactograph.graph.plan.make_plan import make_plan
from tactograph.graph.plan.plan import Plan
from tactograph.graph.run.open_pipeline import placeholders
from tests.graph.conftest import SLOPES, Write


def planned(file: str, device: OpenCL | None) -> Plan:
    graph = read_graph(file)
    return make_plan(graph, placeholders(graph), device=device)


def test_every_step_and_every_edge_is_drawn_once(write: Write, device: OpenCL) -> None:
    plan = planned(write(SLOPES), device)
    dot = to_dot(plan)
    mermaid = to_mermaid(plan)
    assert len(re.findall(r"^  n\d+[\[(]", mermaid, re.MULTILINE)) == len(plan.steps)
    for step in plan.steps:
        assert dot.count(f'\n  "{step.name}" [label=') == 1
    assert dot.count(" -> ") == mermaid.count(" -->|") == len(edges(plan))


def test_the_nodes_of_a_use_are_drawn_together(device: OpenCL) -> None:
    noted = {"op": "rest_at_border", "in": {"height": "height"}}
    groups = {
        "one": {"inputs": {"height": {}}, "nodes": {"n": noted}, "outputs": {"height": "n"}},
        "two": {
            "inputs": {"height": {}},
            "nodes": {
                "a": {"group": "one", "in": {"height": "height"}},
                "b": {"op": "rest_at_border", "in": {"height": "a.height"}},
            },
            "outputs": {"height": "b"},
        },
    }
    use = {"group": "two", "in": {"height": "ball"}}
    ball = {"op": "shape_ball", "with": {"width_px": 32, "height_px": 24}}
    graph = {"format": 1, "groups": groups, "outputs": {"height": "use.height"}}
    nodes = {"shape": ball, "ball": {**noted, "in": {"height": "shape.height"}}, "use": use}
    plan = make_plan(read_graph({**graph, "nodes": nodes}), {}, device=None)
    assert [line.split(" [")[0].strip() for line in to_dot(plan).splitlines()[3:12]] == [
        '"shape"',
        '"ball"',
        'subgraph "cluster_use" { label="use"; color="#999999"; fontsize=10;',
        '"use.b"',
        'subgraph "cluster_use.a" { label="use.a"; color="#999999"; fontsize=10;',
        '"use.a.n"',
        "}",
        "}",
        '"shape" -> "ball"',
    ]
    mermaid = to_mermaid(plan)
    assert re.findall(r"subgraph (\S+)|(\bend)$", mermaid, re.MULTILINE) == [
        ('use_use["use"]', ""),
        ('use_use_a["use.a"]', ""),
        ("", "end"),
        ("", "end"),
    ]


def test_an_edge_runs_through_its_transfer(write: Write, device: OpenCL) -> None:
    drawn = edges(planned(write(SLOPES), device))
    assert ("height", "upload height.read_height", "read_height") in drawn
    assert ("upload height.read_height", "slope", "read_height") in drawn
    assert ("height", "slope", "read_height") not in drawn


def test_without_a_device_no_transfer_is_drawn(write: Write) -> None:
    assert ("height", "slope", "read_height") in edges(planned(write(SLOPES), None))


def test_the_back_ends_have_colours_of_their_own(write: Write, device: OpenCL) -> None:
    dot = to_dot(planned(write(SLOPES), device))
    colours = set(re.findall(r'fillcolor="(#\w+)"', dot))
    assert len(colours) == 2


@pytest.mark.parametrize("name", shipped_names())
def test_every_edge_joins_two_steps(name: str, device: OpenCL) -> None:
    plan = planned(name, device)
    steps = {step.name for step in plan.steps}
    assert all({a, b} <= steps for a, b, _ in edges(plan))


@pytest.mark.parametrize("name", ['we"ird.yaml', "back\\slash.yaml", "two words.yaml"])
def test_the_name_of_the_file_breaks_no_quotes(write: Write, name: str) -> None:
    first = to_dot(planned(write(SLOPES, name), None)).splitlines()[0]
    assert re.fullmatch(r'digraph "(?:[^"\\]|\\.)*" \{', first)


@pytest.mark.skipif(shutil.which("dot") is None, reason="graphviz is not here")
def test_graphviz_takes_the_dot_file(write: Write, device: OpenCL, tmp_path: Path) -> None:
    dot = to_dot(planned("paper", device))
    done = subprocess.run(["dot", "-Tsvg"], input=dot, capture_output=True, text=True, check=True)
    assert "<svg" in done.stdout


@pytest.mark.parametrize("name", ["precise", "reconstruct_follow_drift"])
def test_boxes_of_the_svg_stand_apart_and_every_edge_goes_right(name: str, device: OpenCL) -> None:
    plan = planned(name, device)
    svg = to_svg(plan)
    corners = re.findall(r'<g[^>]*>\s*<rect x="(\d+)" y="(\d+)"', svg)
    assert len(set(corners)) == len(corners) == len(plan.steps)
    solid = re.findall(r'<path d="M(\d+) \S+C.* (\d+) \S+" fill="none" stroke="#777" m', svg)
    assert len(solid) == len(edges(plan))
    assert all(int(start) < int(end) for start, end in solid)


def test_the_svg_is_well_formed_whatever_the_file_is_called(write: Write) -> None:
    svg = to_svg(planned(write(SLOPES, "a<b&c.yaml"), None))
    assert ElementTree.fromstring(svg)[0].text == "a<b&c"
