"""A table as plain text that cuts no cell, however narrow the terminal is."""

from collections.abc import Iterator, Sequence
from textwrap import wrap

from rich.cells import cell_len

COLUMN_GAP = "  "


def fitting_table(
    headings: Sequence[str], rows: Sequence[Sequence[str]], labels: int, width: int
) -> str:
    """Draw a table in the first shape that is no wider than `width`; `labels` columns go left.

    The shapes are: headings of one line; headings of several lines; a column for each row, in as
    many blocks as needed.  A single column that is wider is drawn all the same.
    """
    for fold in (False, True):
        text = _upright(headings, rows, labels, fold)
        if max(map(cell_len, text.splitlines())) <= width:
            return text
    return "\n\n".join(_drawn([headings, *block], 1) for block in _blocks(headings, rows, width))


def _upright(
    headings: Sequence[str], rows: Sequence[Sequence[str]], labels: int, fold: bool
) -> str:
    columns = list(zip(*rows, strict=True))
    heads = [
        _folded(heading, column) if fold else [heading]
        for heading, column in zip(headings, columns, strict=True)
    ]
    tallest = max(map(len, heads))
    whole = [
        [*[""] * (tallest - len(head)), *head, *column]
        for head, column in zip(heads, columns, strict=True)
    ]
    return _drawn(whole, labels)


def _folded(heading: str, column: Sequence[str]) -> list[str]:
    """A heading in lines that are no wider than its longest word or its column."""
    width = max(_width(column), _width(heading.split()))
    return wrap(heading, width, break_long_words=False, break_on_hyphens=False)


def _blocks(
    head: Sequence[str], columns: Sequence[Sequence[str]], width: int
) -> Iterator[list[Sequence[str]]]:
    """The columns in blocks that fit beside `head`."""
    block: list[Sequence[str]] = []
    left = width - _width(head)
    for column in columns:
        needed = len(COLUMN_GAP) + _width(column)
        if block and needed > left:
            yield block
            block, left = [], width - _width(head)
        block.append(column)
        left -= needed
    yield block


def _drawn(columns: Sequence[Sequence[str]], labels: int) -> str:
    padded = [_padded(column, number >= labels) for number, column in enumerate(columns)]
    return "\n".join(COLUMN_GAP.join(cells).rstrip() for cells in zip(*padded, strict=True))


def _padded(column: Sequence[str], right: bool) -> list[str]:
    width = _width(column)
    blanks = [" " * (width - cell_len(text)) for text in column]
    pairs = zip(blanks, column, strict=True)
    return [blank + text if right else text + blank for blank, text in pairs]


def _width(column: Sequence[str]) -> int:
    return max(map(cell_len, column))
