"""A calibration and its picture replace earlier ones of their kind, and nothing else."""

from pathlib import Path
from typing import Annotated, NamedTuple

import cv2
import numpy as np
import pytest
from matplotlib.figure import Figure

from tactograph.graph import InputError, Provenance
from tactograph.graph.declare.check_settings import check_settings
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.plan.names import bind
from tactograph.nodes import Lens
from tactograph.nodes.drawing.new_picture import NewPicture
from tactograph.nodes.files.calibration_file import FileKind
from tactograph.nodes.stored import Stored

PROVENANCE = Provenance({}, None, [], {}, {}, [], [])
WRITERS = ("write_calibration",)
PICTURES = ("plot_calibration",)


def check(node: str, file: Path) -> None:
    check_settings(find_node(node), {"file": str(file)}, lambda name: f"{node}: {name}")


class Camera(NamedTuple):
    lens: Annotated[Lens, Stored(-10, 10), ""] = np.zeros(8, np.float32)


def camera(file: Path) -> None:
    kind = FileKind("camera", 1, "run calibrate_camera", Camera, sources="", users="")
    kind.write_record(file, Camera(), {"provenance": PROVENANCE})


@pytest.mark.parametrize("node", WRITERS)
def test_foreign_arrays_are_not_overwritten(node: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.npz"
    check(node, file)
    np.savez(file, mine=np.ones(3))
    with pytest.raises(InputError, match=r"the name of a new file, or of an earlier .*, is needed"):
        check(node, file)
    file.write_text("not even an archive")
    with pytest.raises(InputError, match=r"the name of a new file, or of an earlier .*, is needed"):
        check(node, file)


def test_a_calibration_is_replaced_by_one_of_its_kind_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "cal.npz"
    camera(file)
    with pytest.raises(
        InputError, match="the name of a new file, or of an earlier calibration, is"
    ):
        check("write_calibration", file)
    monkeypatch.chdir(tmp_path)
    graph = read_graph("calibrate")
    with pytest.raises(InputError, match=r"^calibrate: give out=, since its default is not"):
        bind(graph, graph.placeholders, sinks=True)


@pytest.mark.parametrize("node", PICTURES)
@pytest.mark.parametrize("content", ["photo", "text", "folder"])
def test_a_photo_is_not_overwritten(node: str, content: str, tmp_path: Path) -> None:
    picture = tmp_path / "photo.png"
    file = picture.with_suffix(".npz")
    check(node, file)
    NewPicture(picture).write(Figure())
    check(node, file)
    picture.unlink()
    if content == "folder":
        picture.mkdir()
    elif content == "text":
        picture.write_text("my notes")
    else:
        cv2.imwrite(str(picture), np.full((4, 5, 3), 99, np.uint8))
    with pytest.raises(InputError, match=r"(earlier|no) picture of a calibration.* is needed"):
        check(node, file)
