"""Describe YAML errors in plain words: the place, and what to do."""

import re

from ruamel.yaml.error import MarkedYAMLError, StringMark

from tactograph.graph.errors import printable

_LINE_END = re.compile(r"\r\n|\r|\n")
_BAD_CHARACTER = re.compile(r"found character '(.+)' that cannot start any token")


def in_words(error: MarkedYAMLError, name: str) -> str:
    """Describe a parser's error as ``file:line:column`` and a sentence."""
    problem = (error.problem or error.context or "").partition("\n")[0]
    context = error.context or ""
    at, start = error.problem_mark or error.context_mark, error.context_mark
    if at is None:
        return f"{name}: not YAML: {printable(problem)}"
    if start is not None and ("simple key" in context or "quoted scalar" in context):
        at = start  # the parser notices only later
    message = _sentence(problem, context, at, start) or f"not YAML: {printable(problem)}"
    return f"{name}:{at.line + 1}:{at.column + 1}: {message}"


def _sentence(problem: str, context: str, at: StringMark, start: StringMark | None) -> str:
    """Translate one of the parser's phrases; empty for a rare one."""
    word = _BAD_CHARACTER.match(problem)
    if word is not None:
        if word[1] in ("\t", r"\t"):
            return "a tab; indent with spaces"
        return f"a value cannot begin with '{printable(word[1])}'; put it in quotes"
    if "another document" in problem:
        return "a second document begins here; a file holds one"
    if "unknown escape character" in problem:
        return (
            "within double quotes \\ begins a special character; use single quotes, or write \\\\"
        )
    if "mapping values are not allowed" in problem:
        return _second_colon(at)
    if "simple key" in context:
        return "no ':' follows this name; write 'name: value'"
    if "quoted scalar" in context:
        return "the quote that begins here is not closed"
    if start is None:
        return ""
    since = f"line {start.line + 1}"
    if "flow" in context:
        bracket = "{" if "mapping" in context else "["
        return f"a comma is missing, or the '{bracket}' of {since} is not closed before here"
    if "expected <block end>" in problem:
        return _other_level(context, at, start)
    return ""


def _second_colon(at: StringMark) -> str:
    if ": " in _lines(at)[at.line][: at.column]:
        return "a second ':' in this line; put the value in quotes, or begin a new line"
    return "indented further than the line above, which has a value already; indent it alike"


def _other_level(context: str, at: StringMark, start: StringMark) -> str:
    """Describe a line that belongs to no level above it."""
    lines = _lines(at)
    if lines[at.line][: at.column].strip(" -"):
        return "this belongs to nothing before it in the line; put the value in quotes"
    if at.column != start.column:
        before = [line for line in lines[: at.line] if line.strip() and line.lstrip()[0] != "#"]
        levels = sorted({len(line) - len(line.lstrip()) for line in before})
        return (
            f"indented by {at.column}, but the lines above by {' or '.join(map(str, levels))}; "
            "indent it like its neighbours"
        )
    first = f"in line {start.line + 1}"
    if "mapping" in context:
        return f"an entry of a list among the names that begin {first}; write 'name: value'"
    return (
        f"no entry of the list that begins {first}; begin it with '- ', or indent it further "
        "than the dash"
    )


def _lines(mark: StringMark) -> list[str]:
    return _LINE_END.split(mark.buffer or "")
