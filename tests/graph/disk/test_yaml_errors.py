"""Errors of YAML are explained in plain words, with the place and the remedy."""

import pytest

from tests.graph.disk.test_strict_yaml import refusal


@pytest.mark.parametrize("text", ["nodes:\n\tx: 1", "nodes:\n  x: 1\n\ty: 1"])
def test_the_error_of_a_tab_says_to_indent_with_spaces(text: str) -> None:
    assert refusal(text).endswith("a tab; indent with spaces")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a:\n  x: 1\n   y: 2", "3:5: indented further than the line above, which has a value"),
        ("a:\n  x: {}\n   y: {}", "3:4: indented by 3, but the lines above by 0 or 2; indent it"),
        ("a:\n    x: {}\n  y: {}", "3:3: indented by 2, but the lines above by 0 or 4; indent it"),
        ("a:\n  - x\n  b: 1", "3:3: no entry of the list that begins in line 2; begin it with"),
        ("a:\n  b: 1\n  - x", "3:3: an entry of a list among the names that begin in line 2"),
        ("a: {x: 1} b", "1:11: this belongs to nothing before it in the line"),
        ("a: b: c", "1:5: a second ':' in this line; put the value in quotes"),
        ("a: 1\nb\nc: 2", "2:1: no ':' follows this name; write 'name: value'"),
        ("a: {x: 1\nb: 2", "2:2: a comma is missing, or the '{' of line 1 is not closed"),
        ("a: [x, y\nb: 2", "2:2: a comma is missing, or the '[' of line 1 is not closed"),
        ('a: 1\nb: "x\n', "2:4: the quote that begins here is not closed"),
        ("a: 1\nb: %x\n", "2:4: a value cannot begin with '%'; put it in quotes"),
        ('a: "C:\\q"', "1:4: within double quotes \\ begins a special character"),
        ("a: 1\n---\nb: 2", "2:1: a second document begins here; a file holds one"),
    ],
)  # fmt: skip
def test_a_syntax_error_is_reported_with_its_place_and_remedy(text: str, message: str) -> None:
    error = refusal(text)
    assert error.startswith(f"g.yaml:{message}")
    assert "\n" not in error
    assert "block" not in error
