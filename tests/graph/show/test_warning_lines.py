"""Warnings of many runs are told in few lines, and none is passed over without a word."""

from tactograph.graph.show.warning_lines import warning_lines


def test_a_warning_is_told_once_with_its_first_place() -> None:
    found = [("a", ["dark", "swapped"]), ("b", ["swapped"]), ("c", ["swapped"])]
    assert warning_lines(found) == ["warning: a: dark", "warning: a and 2 more: swapped"]


def test_a_place_that_a_warning_names_is_not_told_twice() -> None:
    assert warning_lines([("day/a", ["day/a/led1.png: dark"])]) == ["warning: day/a/led1.png: dark"]


def test_what_is_not_told_is_counted() -> None:
    found = [("a", ["1", "2", "3", "4", "5"])]
    assert warning_lines(found)[3:] == ["warning: 2 more, see the table"]
    assert len(warning_lines(found, None)) == 5
    assert warning_lines([("a", [])]) == []
