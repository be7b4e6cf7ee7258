"""Errors and warnings in one line: what is wrong, where, and what to do.

A node's message names a parameter or an input in backticks, with a value if the user has to give
one: ``"the pixel size is not known; give `pixel_mm`=MM"``.  `as_in_graph` replaces the name by what
feeds it in the running graph: ``pixel_size_mm=MM``.
"""

import difflib
import errno
import re
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from traceback import walk_tb
from typing import NamedTuple, Self, TypeVar

T = TypeVar("T")
R = TypeVar("R")
MAX_CHARACTERS = 2000
"""Largest number of characters to print of a text from a file."""
MARKED_NAME = re.compile(r"`(\w+(?:\.\w+)*)`(=(?:[^\s;:()]*[^\s;:(),.])?)?")
"""A marked name in a node's message, and the value that follows it."""
_CUT_SHORT = re.compile(r"\d+ requested and \d+ written")


class TactographError(Exception):
    """Base of every error this package raises on purpose.  Exit code 1.

    `item` is the name of the stream's item that raised it, if the item has a name.  `others` are
    further errors of the same file.
    """

    exit_code = 1
    item = ""
    others: Sequence[str] = ()

    def at_item(self, name: str) -> None:
        """Put the item's name before the message."""
        if name:
            self.item, self.args = name, (f"{name}: {self}",)


class InputError(TactographError):
    """The user's graph, file or value is wrong.  One clear line; exit code 2."""

    exit_code = 2

    @classmethod
    def unknown(cls, message: str, name: str, known: Iterable[str]) -> Self:
        """Return the error of a name that is none of those `known`, with the closest, or all."""
        names = [*known]
        return cls(message + (did_you_mean(name, names) or f"; it has {', '.join(names)}"))


class GraphError(InputError):
    """A graph file is wrong; the message begins with the place, ``file:line:column``."""


class ErrorsTogether:
    """Gathers the errors of independent blocks, to raise them together."""

    def __init__(self) -> None:
        self._errors: dict[str, GraphError] = {}

    @contextmanager
    def gathered(self) -> Iterator[None]:
        """Note a GraphError of the block, and continue behind it."""
        try:
            yield
        except GraphError as error:
            self._errors.setdefault(str(error), error)

    @classmethod
    def of_all(cls, items: Iterable[T], work: Callable[[T], R]) -> dict[T, R]:
        """Return what `work` returns for each item; raise the errors of all of them together."""
        errors, results = cls(), dict[T, R]()
        for item in items:
            with errors.gathered():
                results[item] = work(item)
        errors.raise_any()
        return results

    def raise_any(self) -> None:
        """Raise the first error, with the others."""
        if self._errors:
            first, *rest = self._errors.values()
            more = [line for error in rest for line in (str(error), *error.others)]
            first.others = [*first.others, *more]
            raise first


class WriteError(InputError):
    """A file cannot be written: the disk is full, or a permission is missing."""


class NodeError(TactographError):
    """A node broke its own declaration, or failed for a reason that is not the user's."""


class DeviceError(NodeError):
    """A device failed; the pipeline may have to be loaded again."""


class NotBuiltError(TactographError):
    """Kernels would have to be compiled first, and the caller does not wait for that.

    Parameters
    ----------
    share : share of the needed programs that are not built, 0 to 1
    """

    def __init__(self, message: str, share: float = 1.0) -> None:
        super().__init__(message)
        self.share = share


class EndOfStream(Exception):  # noqa: N818  (nothing went wrong)
    """Raised by a sink to end the stream after this item, which still counts."""


def message_of(error: BaseException) -> str:
    """The message of an exception; a foreign exception may fail even when asked for it."""
    try:
        return str(error)
    except Exception as second:
        return f"its message cannot be read ({type(second).__name__})"


def full_disk(error: BaseException) -> WriteError | None:
    """An error for the user if `error` means that a disk is full, else None."""
    if not isinstance(error, OSError):
        return None
    # NumPy gives no errno if it could write only a part of an array.
    reason = "No space left on device" if _CUT_SHORT.fullmatch(str(error)) else error.strerror
    if reason == error.strerror and error.errno not in (errno.ENOSPC, errno.EDQUOT):
        return None
    where = error.filename or "a disk"
    return WriteError(f"{where}: {reason}; make room, or set TMPDIR to a folder with room")


def of_system(error: BaseException) -> InputError | None:
    """An error for the user if a disk is full or a file is not theirs to use, else None."""
    if isinstance(error, PermissionError) and error.filename:
        return InputError(f"{error.filename}: {error.strerror}")
    return full_disk(error)


def printable(text: str) -> str:
    """Text whose control characters are replaced by ``\\x1b`` and the like."""
    return "".join(c if c in "\n\t" or not _is_control(c) else f"\\x{ord(c):02x}" for c in text)


def one_line(text: str) -> str:
    """Text from a file as one printable line of limited length."""
    start = text[:MAX_CHARACTERS].encode("utf-8", "backslashreplace").decode()
    more = "…" if len(text) > MAX_CHARACTERS else ""
    return printable(" ".join(start.splitlines())).replace("\t", " ") + more


def shortened(text: str, most: int = 60) -> str:
    """A text, shortened for a message."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


def _is_control(character: str) -> bool:
    """Return whether a character controls a terminal or the direction of the text."""
    kind = unicodedata.category(character)
    return kind == "Cc" or (kind == "Cf" and unicodedata.bidirectional(character) in _BIDI_CLASSES)


_BIDI_CLASSES = {"LRE", "RLE", "PDF", "LRO", "RLO", "LRI", "RLI", "FSI", "PDI"}


def did_you_mean(word: str, choices: Iterable[str], lister: str = "") -> str:
    """Return ``"; did you mean 'x'?"`` for the closest known word, else an empty string.

    If `lister` is a command that lists all choices, name up to three of them, and that command.
    """
    words = list(choices)
    few = difflib.get_close_matches(word, words, n=3, cutoff=0.75) if lister else []
    close = few or difflib.get_close_matches(word, words, n=1, cutoff=0.6)
    meant = " or ".join(filter(None, [", ".join(map(repr, close[:-1])), *map(repr, close[-1:])]))
    hint = f"; did you mean {meant}?" if close else ";" if lister else ""
    return f"{hint} '{lister}' lists all" if lister else hint


def missing(path: Path, what: str) -> str:
    """Say that a path does not exist, and suggest a similar name beside it.

    `what` is the noun for the path, such as ``folder``.
    """
    first = next((each for each in (path, *path.parents) if each.parent.is_dir()), path)
    where = "" if first == path else f", nor '{first}'"
    try:
        if first.is_symlink():
            return f"{path}: there is no such {what}; '{first}' is a link to '{first.readlink()}'"
        siblings = [each.name for each in first.parent.iterdir()]
    except (OSError, ValueError):  # a name that no file can have
        siblings = []
    return f"{path}: there is no such {what}{where}{did_you_mean(first.name, siblings)}"


def a_few(words: Sequence[str], most: int) -> str:
    """Join the first words of a list, and count the rest: ``a, b and 3 more``."""
    more = len(words) - most
    return ", ".join(words[:most]) + (f" and {more} more" if more > 0 else "")


Feed = Callable[[str], str | None]
"""What feeds a parameter or input: ``param=`` of the graph, a ``--set node.param=``, or a node in
words; None for a name that the node does not have."""


def as_in_graph(message: str, feed: Feed) -> str:
    """Replace the marked names in a node's message by what feeds them.

    A value is kept if the user can set the name, and dropped if a node feeds it.
    """

    def fed(match: re.Match[str]) -> str:
        name, value = match.group(1), match.group(2) or ""
        source = feed(name)
        if source is None:
            return match.group(0)
        return source.removesuffix("=") + (value if source.endswith("=") else "")

    return MARKED_NAME.sub(fed, message)


class _Collector(NamedTuple):
    """The list for warnings, the feeds of marked names, and whether warnings keep their marks."""

    notes: list[str]
    feed: Feed | None = None
    marked: bool = False


_collector: ContextVar[_Collector | None] = ContextVar("tactograph_warnings", default=None)


def warn(message: str) -> None:
    """Warn the user without stopping the run.

    The engine prints it once and writes it into ``result.json``.  Outside a run
    (a node called as a plain function) it does nothing.
    """
    collector = _collector.get()
    if collector is None:
        return
    line = message if collector.feed is None else as_in_graph(message, collector.feed)
    if line not in collector.notes:
        collector.notes.append(line)


def is_of_printing(error: OSError) -> bool:
    """Return whether click or rich raised it because the reader, such as ``| head``, has gone."""
    modules = [frame.f_globals["__name__"] for frame, _ in walk_tb(error.__traceback__)]
    return modules[-1].partition(".")[0] in ("click", "rich")


@contextmanager
def collect_warnings(notes: list[str], *, marked: bool = False) -> Iterator[list[str]]:
    """Collect the warnings of the block in `notes`, and yield that list.

    With `marked` they keep the marks of names, since the graph is not known yet.
    """
    token = _collector.set(_Collector(notes, marked=marked))
    try:
        yield notes
    finally:
        _collector.reset(token)


class GraphNames:
    """A block whose errors and warnings name what feeds a node's parameters and inputs."""

    __slots__ = ("_feed", "_token")

    def __init__(self, feed: Feed) -> None:
        self._feed = feed

    def __enter__(self) -> None:
        outer = _collector.get()
        if outer is not None and not outer.marked:
            outer = _Collector(outer.notes, self._feed)
        self._token = _collector.set(outer)

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        _collector.reset(self._token)
        if isinstance(error, TactographError):
            error.args = (as_in_graph(str(error), self._feed),)
