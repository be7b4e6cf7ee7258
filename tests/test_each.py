"""A statement over many cases reports all that fail, and needs at least one case."""

from pathlib import Path

import pytest

from tests.each import each


@each("low, high", [(1, 2), (2, 3)])
def test_cases_unpack_together_with_fixtures(tmp_path: Path, low: int, high: int) -> None:
    assert tmp_path.is_dir()
    assert low < high


def test_all_cases_that_fail_are_reported() -> None:
    @each("number", [1, 20, 3, 40])
    def small(number: int) -> None:
        assert number < 10, f"{number} is large"

    with pytest.raises(pytest.fail.Exception, match=r"2 of 4 fail\n20: .*\n.*\n40: ") as failure:
        small()
    assert "3 is large" not in str(failure.value)


def test_a_statement_over_no_case_is_refused() -> None:
    with pytest.raises(AssertionError, match="name"):
        each("name", [])
