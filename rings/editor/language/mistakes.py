"""What `check` finds wrong in a text that is not saved yet, and what it may have meant."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from tactograph.sdk import Graph, GraphFile, Pipeline, TactographError

_MEANT_WORDS = re.compile(r"'([^']+)'[^']*; did you mean (('[^']+'(?:, | or )?)+)\?")
_QUOTED_WORD = re.compile(r"'([^']+)'")
_FORMAT_KEY = re.compile(r"^format:", re.MULTILINE)
_GRAPH_KEY = re.compile(r"^(nodes|extends|base|variants|patch|inputs):", re.MULTILINE)


class Mistake(NamedTuple):
    """What is wrong: line and columns from 0, the sentence, and words that were meant instead."""

    line: int
    start: int
    end: int
    sentence: str
    meant: tuple[str, ...] = ()


class Checked(NamedTuple):
    """The graph of a text, if it can be read, and its mistakes."""

    graph: Graph | None
    mistakes: list[Mistake]


def check(text: str, file: Path) -> Checked:
    """Read and plan a text's graph and its variants; each error once.

    YAML that is no graph has no mistakes.
    """
    if not (_FORMAT_KEY.search(text) and _GRAPH_KEY.search(text)):
        return Checked(None, [])
    messages: dict[str, None] = {}
    graphs: list[Graph] = []
    with _gathered(messages):
        graphs = GraphFile(file).graphs_of(text)
    for graph in graphs:
        with _gathered(messages):
            Pipeline.verify(graph)
    lines = text.splitlines()
    return Checked(graphs[0] if graphs else None, [_placed(each, lines, file) for each in messages])


@contextmanager
def _gathered(messages: dict[str, None]) -> Iterator[None]:
    try:
        yield
    except TactographError as error:
        messages |= dict.fromkeys([str(error), *error.others])


def _placed(message: str, lines: list[str], file: Path) -> Mistake:
    """An error at its place in this file, or at the top where it is in another."""
    place = re.search(rf"{re.escape(str(file))}:(\d+):(\d+): ", message)
    row, column = (int(n) - 1 for n in place.groups()) if place else (0, 0)
    if place and not place.start():
        message = message[place.end() :]
    meant = _MEANT_WORDS.search(message)
    wrong = meant[1] if meant else ""
    row, column, word = _of_word(wrong, lines, row, column)
    words = tuple(_QUOTED_WORD.findall(meant[2])) if meant and word == wrong else ()
    return Mistake(row, column, column + max(len(word), 1), message, words)


def _of_word(wrong: str, lines: list[str], row: int, column: int) -> tuple[int, int, str]:
    """Where a wrong word stands, at a place or in its line; else the word at the place."""
    line = lines[row] if row < len(lines) else ""
    place = wrong and re.compile(rf"(?<![\w.]){re.escape(wrong)}(?!\w)").search(line, column)
    if place:
        return row, place.start(), wrong
    word = re.compile(r"[\w.$-]*").match(line, column)
    return row, column, word[0] if word else ""
