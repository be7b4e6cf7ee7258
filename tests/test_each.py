"""A statement over many cases tells all that fail, and has cases."""

from pathlib import Path

import pytest

from tests.each import each


@each("low, high", [(1, 2), (2, 3)])
def test_cases_unpack_beside_fixtures(tmp_path: Path, low: int, high: int) -> None:
    assert tmp_path.is_dir()
    assert low < high


def test_all_cases_that_fail_are_told() -> None:
    @each("number", [1, 20, 3, 40])
    def small(number: int) -> None:
        assert number < 10, f"{number} is large"

    with pytest.raises(pytest.fail.Exception, match=r"2 of 4 fail\n20: .*\n.*\n40: ") as found:
        small()
    assert "3 is large" not in str(found.value)


def test_a_statement_over_nothing_is_none() -> None:
    with pytest.raises(AssertionError, match="name"):
        each("name", [])
