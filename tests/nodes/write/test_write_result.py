"""What a result says beside its heights."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from tactograph.graph import Provenance
from tactograph.graph.errors import collect_warnings
from tactograph.nodes.write.write_result import write_result

SHAPE = (8, 10)
MADE = Provenance({}, None, [], {}, {}, [], [])


def write(folder: Path, count: int, shadow: int, highlight: int | None = None) -> list[str]:
    """Write a flat film's result; the warnings that came with it."""
    level = np.zeros(SHAPE, np.float32)
    bits = np.full(SHAPE, shadow, np.uint8)
    mirrored = None if highlight is None else np.full(SHAPE, highlight, np.uint8)
    notes: list[str] = []
    with collect_warnings(notes):
        write_result(
            level, bits, np.ones((count, *SHAPE), np.float32), 0.1, {}, "",
            highlight=mirrored, folder=folder, mesh=False, pictures=False, provenance=MADE,
        )  # fmt: skip
    return notes


@pytest.mark.parametrize(
    ("count", "shadow", "warned"), [(3, 0, False), (3, 0b10, True), (4, 0b10, False)]
)
def test_a_shadow_under_three_leds_is_a_warning(
    tmp_path: Path, count: int, shadow: int, warned: bool
) -> None:
    notes = write(tmp_path, count, shadow)
    assert bool(notes) == warned
    assert all("two lights allow two slopes" in note for note in notes)


def test_highlights_are_written_where_the_graph_gives_them(tmp_path: Path) -> None:
    write(tmp_path / "matt", 4, 0)
    write(tmp_path / "glossy", 4, 0, highlight=0b100)
    assert not (tmp_path / "matt" / "highlight.png").exists()
    bits = cv2.imread(str(tmp_path / "glossy" / "highlight.png"), cv2.IMREAD_UNCHANGED)
    assert (bits == 0b100).all()


def test_the_labels_confidence_is_written_beside_them(tmp_path: Path) -> None:
    sure = np.full(SHAPE, 0.75, np.float32)
    write_result(
        np.zeros(SHAPE, np.float32), np.zeros(SHAPE, np.uint8), np.ones((4, *SHAPE), np.float32),
        0.1, {}, "", confidence=sure, folder=tmp_path, mesh=False, provenance=MADE,
    )  # fmt: skip
    assert np.array_equal(np.load(tmp_path / "confidence.npy"), sure)
    assert cv2.imread(str(tmp_path / "confidence.png")) is not None


def test_contacts_are_written_as_their_numbers(tmp_path: Path) -> None:
    numbers = np.zeros(SHAPE, np.uint8)
    numbers[2:4, 3:5] = 2
    write_result(
        np.zeros(SHAPE, np.float32), np.zeros(SHAPE, np.uint8), np.ones((4, *SHAPE), np.float32),
        0.1, {}, "", contact=numbers, folder=tmp_path, mesh=False, pictures=False, provenance=MADE,
    )  # fmt: skip
    kept = cv2.imread(str(tmp_path / "contact.png"), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(kept, numbers)


def test_numbers_that_look_black_have_a_picture_beside_them(tmp_path: Path) -> None:
    numbers = np.zeros(SHAPE, np.uint8)
    numbers[2:4, 3:5], numbers[5:7, 6:9] = 1, 2
    level, nothing = np.zeros(SHAPE, np.float32), np.zeros(SHAPE, np.uint8)
    for name, found in (("free", nothing), ("touched", numbers)):
        write_result(
            level, found, np.ones((4, *SHAPE), np.float32), 0.1, {}, "", contact=found,
            highlight=found, folder=tmp_path / name, mesh=False, provenance=MADE,
        )  # fmt: skip
    for what in ("shadow", "highlight", "contact"):
        views = [tmp_path / name / f"{what}_view.png" for name in ("free", "touched")]
        free, touched = (colours_of(cv2.imread(str(view))) for view in views)
        assert len(touched - free) >= 2, what


def colours_of(picture: np.ndarray) -> set[int]:
    """The colours of at least 2000 pixels of a picture."""
    colours, counts = np.unique(picture @ np.array([1, 256, 65536]), return_counts=True)
    return set(colours[counts >= 2000].tolist())
