"""Where the cursor is in a graph file, though words and brackets may still be missing."""

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from tactograph.sdk import Document, InputError

Path_ = tuple[str | int, ...]
CURSOR_MARK = "_cursor_"
"""Put behind the word at the cursor, so that it is found in what was read."""
_WORD_BEFORE, _WORD_BEHIND = re.compile(r"[\w.$]*$"), re.compile(r"[\w.]*")
_UNREAD_TEXT = re.compile(r"""#[^\n]*|"[^"\n]*"|'[^'\n]*'""")
_CLOSING_BRACKETS = {"{": "}", "[": "]"}


class Cursor(NamedTuple):
    """The file's data, the path of the word at the cursor, whether it is a key, its typed part.

    `entry` is the path of the node, the use of a group or the change around it, if any.
    """

    data: dict[str, Any]
    path: Path_
    is_key: bool
    word: str

    @property
    def entry(self) -> Path_:
        for at, part in enumerate(self.path[:-1], start=1):
            if part in ("nodes", "patch"):
                return self.path[: at + 1]
        return ()

    @property
    def inside(self) -> Path_:
        """The path within the entry; what is typed below `with:` is a key there."""
        inside = self.path[len(self.entry) :]
        return (*inside, self.word) if inside in (("with",), ("in",)) else inside

    def at(self, path: Path_) -> Any:
        """The data at a path; an empty mapping where there is none."""
        value: Any = self.data
        for part in path:
            value = value[part]
        return {} if value is None else value


def mapping(value: Any) -> dict[str, Any]:
    """A mapping as it is; an empty one where something else stands, as while typing."""
    return value if isinstance(value, dict) else {}


def find_cursor(text: str, line: int, column: int) -> Cursor | None:
    """The word at a place, counted from 0; None in a text that cannot be read as YAML at all."""
    start = sum(len(each) for each in text.splitlines(keepends=True)[:line]) + column
    behind = _WORD_BEHIND.match(text, start)
    end = behind.end() if behind else start
    typed = _WORD_BEFORE.search(text[:start])
    for reading in _readings(text[:end], text[end:]):
        try:
            data = Document.parse(reading, "").data
        except InputError:
            continue
        marked = _marked(data, ())
        if marked is not None and isinstance(data, dict):
            return Cursor(_without_mark(data), *marked, typed[0] if typed else "")
    return None


def _readings(before: str, after: str) -> Iterator[str]:
    """Texts with a mark at the cursor: as it is, and with what may still have to be typed."""
    rest, _, below = after.partition("\n")
    line = before.rpartition("\n")[2].strip()
    if not rest.strip() and re.fullmatch(r"[\w.]*", line):
        yield f"{before}{CURSOR_MARK}: 0\n{below}"
    yield f"{before}{CURSOR_MARK}{after}"
    closed = f"{before}{CURSOR_MARK}{_closers(before)}\n"
    yield closed + below
    yield closed


def _closers(text: str) -> str:
    """The brackets that close those still open at a text's end."""
    still_open: list[str] = []
    for letter in _UNREAD_TEXT.sub("", text):
        if letter in _CLOSING_BRACKETS:
            still_open.append(_CLOSING_BRACKETS[letter])
        elif still_open and letter == still_open[-1]:
            still_open.pop()
    return "".join(reversed(still_open))


def _marked(data: Any, path: Path_) -> tuple[Path_, bool] | None:
    """The path of the marked word, and whether it is a key."""
    if isinstance(data, str) and CURSOR_MARK in data:
        return path, False
    inner: list[tuple[str | int, Any]] = []
    if isinstance(data, dict):
        inner = [*data.items()]
    elif isinstance(data, list):
        inner = [*enumerate(data)]
    for key, value in inner:
        if isinstance(key, str) and CURSOR_MARK in key:
            return (*path, key.replace(CURSOR_MARK, "")), True
        if (deeper := _marked(value, (*path, key))) is not None:
            return deeper
    return None


def _without_mark(data: Any) -> Any:
    if isinstance(data, dict):
        return {key.replace(CURSOR_MARK, ""): _without_mark(value) for key, value in data.items()}
    if isinstance(data, list):
        return [_without_mark(value) for value in data]
    return data.replace(CURSOR_MARK, "") if isinstance(data, str) else data
