"""`run --keep` writes inner values to files."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.graph.conftest import SLOPES, STREAM, Command, one_line

WITH_OUT = SLOPES.replace("a height map}\n", "a height map}\n  out: {kind: path, default: out}\n")


def test_inner_values_are_kept_next_to_the_result(
    about: Command, height_file: str, tmp_path: Path, backend: str
) -> None:
    params = (f"file={height_file}", f"out={tmp_path / 'out'}")
    done = about("run", WITH_OUT, *params, "--keep", "slope.slope,pixel", "--backend", backend)
    assert done.code == 0, done.err
    folder = tmp_path / "out" / "kept" / "1"
    assert np.load(folder / "slope.slope.npy").shape == (2, *np.load(height_file).shape)
    assert (folder / "slope.slope.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((folder / "pixel.json").read_text()) == pytest.approx(0.1)


def test_an_output_is_kept_by_its_name(about: Command, height_file: str, tmp_path: Path) -> None:
    params = (f"file={height_file}", f"out={tmp_path / 'out'}")
    assert about("run", WITH_OUT, *params, "--keep", "mask", "--backend", "numpy").code == 0
    assert np.load(tmp_path / "out" / "kept" / "1" / "mask.npy").all()


GROUPED = """
format: 1
params:
  count: {kind: integer, default: 1}
  out:   {kind: path}
prefer: [numpy]
groups:
  more:
    inputs:
      image: {}
    nodes:
      one: {op: doubled, in: {image: image}}
      two: {op: doubled, in: {image: one}}
    outputs: {light: two}
nodes:
  frames: {op: touches, with: {count: $count}}
  use:    {group: more, in: {image: frames.image}}
  again:  {group: more, in: {image: use.light}}
  save:   {op: noted, in: {image: again.light}}
"""


def test_values_inside_a_group_are_kept_too(
    toys: list[str], about: Command, tmp_path: Path
) -> None:
    words = ("run", GROUPED, f"out={tmp_path}")
    done = about(*words, "--keep", "use.one,use.light,use.two.doubled")
    assert done.code == 0, done.err
    folder = tmp_path / "kept" / "1"
    means = {file.stem: np.load(file).mean() for file in folder.glob("*.npy")}
    assert means == {"use.one": 2, "use.light": 4, "use.two.doubled": 4}
    toys.clear()
    done = about(*words, "--keep", "use.tow")
    assert (done.code, "the group 'more' has no output or node 'tow'" in done.err) == (2, True)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (("--keep", "ligth"), "no node or output of that name; did you mean 'light'"),
        (("--keep", "light.high"), "node 'light' has no output 'high'"),
        (("--keep", ","), "--keep ,: write it as node.port,node"),
    ],
)
def test_an_unknown_value_cannot_be_kept(
    toys: list[str], about: Command, option: tuple[str, str], message: str
) -> None:
    assert message in one_line(about("run", STREAM, *option))
    assert toys == []
