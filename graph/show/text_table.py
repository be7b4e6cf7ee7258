"""A table as plain text that cuts no cell, however narrow the terminal is."""

from collections.abc import Iterator, Sequence

from rich.cells import cell_len

COLUMN_GAP = "  "


def fitting_table(
    headings: Sequence[str], rows: Sequence[Sequence[str]], labels: int, width: int
) -> str:
    """Draw a table that is no wider than `width`; `labels` columns go left.

    If it would be wider, each row becomes a column, in as many blocks as needed.  A single column
    may still be wider.
    """
    columns = zip(headings, *rows, strict=True)
    text = _drawn(list(columns), labels)
    if max(map(cell_len, text.splitlines())) <= width:
        return text
    return "\n\n".join(_drawn([headings, *block], 1) for block in _blocks(headings, rows, width))


def _blocks(
    head: Sequence[str], columns: Sequence[Sequence[str]], width: int
) -> Iterator[list[Sequence[str]]]:
    """The columns in blocks that fit beside `head`."""
    block: list[Sequence[str]] = []
    room = width - _width(head)
    for column in columns:
        needed = len(COLUMN_GAP) + _width(column)
        if block and needed > room:
            yield block
            block, room = [], width - _width(head)
        block.append(column)
        room -= needed
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
