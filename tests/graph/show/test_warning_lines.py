"""Warnings of many runs are printed in few lines, and the omitted ones are counted."""

from tactograph.graph.show.warning_lines import warning_lines


def test_a_warning_is_printed_once_with_its_first_place() -> None:
    warnings = [("a", ["dark", "swapped"]), ("b", ["swapped"]), ("c", ["swapped"])]
    assert warning_lines(warnings) == ["warning: a: dark", "warning: a and 2 more: swapped"]


def test_a_place_that_a_warning_names_is_not_printed_twice() -> None:
    assert warning_lines([("day/a", ["day/a/led1.png: dark"])]) == ["warning: day/a/led1.png: dark"]


def test_omitted_warnings_are_counted() -> None:
    warnings = [("a", ["1", "2", "3", "4", "5"])]
    assert warning_lines(warnings)[3:] == ["warning: 2 more, see the table"]
    assert len(warning_lines(warnings, None)) == 5
    assert warning_lines([("a", [])]) == []
