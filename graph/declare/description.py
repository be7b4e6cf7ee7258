"""The parsed docstring (NumPy style) of a node."""

import inspect
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Self

import docstring_parser

_RETURNS_SECTION = re.compile(
    r"^Returns\n-+\n(.*?)(?=\n\n[A-Z]\w*\n-+\n|\Z)", re.DOTALL | re.MULTILINE
)
"""The whole section; the parser would take every line that is not indented for a value."""


@dataclass(frozen=True)
class Description:
    """The parts of a docstring; an argument without a description has an empty string."""

    summary: str
    text: str
    arguments: dict[str, str]
    returns: str
    raises: list[tuple[str, str]]

    @classmethod
    def of(
        cls,
        doc: str,
        arguments: Iterable[str],
        quantities: Mapping[str, str],
        records: Iterable[type],
    ) -> Self:
        """Parse the docstring of a node with these arguments.

        Arguments that it does not describe take the words of `quantities` and of `records`.
        """
        parsed = _parsed(doc)
        meanings = {**quantities}
        pages = (*(_parsed(inspect.getdoc(record) or "") for record in records), parsed)
        for each in (param for page in pages for param in page.params):
            for name in each.arg_name.split(","):
                name = name.strip(" *")
                meaning = meanings.get(name), each.type_name
                meanings[name] = _one_line(each.description) or "; ".join(filter(None, meaning))
        returns = _RETURNS_SECTION.search(inspect.cleandoc(doc))
        return cls(
            summary=_one_line(parsed.short_description),
            text=parsed.long_description or "",
            arguments={name: meanings.get(name, "") for name in arguments},
            returns=_one_line(returns[1]) if returns else "",
            raises=[(each.type_name or "", _one_line(each.description)) for each in parsed.raises],
        )


def _parsed(doc: str) -> docstring_parser.Docstring:
    return docstring_parser.parse(doc, docstring_parser.DocstringStyle.NUMPYDOC)


def _one_line(text: str | None) -> str:
    return re.sub(r"\s+", " ", text or "").strip()
