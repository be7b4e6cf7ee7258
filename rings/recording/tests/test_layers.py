"""A layer of another package is sent as a message."""

from pathlib import Path

from mcap.reader import make_reader

from tactograph.graph.command import run_command
from tests.nodes.stream.test_layer_kinds import GRAPH, WARMTH, Lay, ring, write_inputs

__all__ = ["ring"]
LOG = "  log: {op: write_mcap, in: {touch: touch}, with: {folder: $out, wait: true}}\noutputs:"


def test_a_layer_of_another_package_is_a_topic(ring: Lay, tmp_path: Path) -> None:
    ring("warmth", WARMTH)
    (tmp_path / "graph.yaml").write_text(GRAPH.replace("outputs:", LOG))
    _, words = write_inputs(tmp_path)
    out = tmp_path / "out"
    run_command(["run", *words, f"capture={tmp_path / 'capture'}", f"out={out}"])
    (file,) = out.glob("*.mcap")
    with file.open("rb") as stream:
        topics = {channel.topic for _, channel, _ in make_reader(stream).iter_messages()}
    assert "/warm" in topics
