"""A statement over all shipped nodes, graphs or files as one test."""

import inspect
from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any

import pytest

Test = Callable[..., None]


def each(names: str, cases: Iterable[Any]) -> Callable[[Test], Test]:
    """Run a test's body for every case, and report all the cases that fail together.

    A case of `pytest.mark.parametrize` costs its own set-up, report and line, which is more than
    such a statement takes.  The cases share the test's fixtures.

    Parameters
    ----------
    names
        The argument that a case is, or names with commas for what it unpacks to.
    cases
        At least one; a statement over nothing would hold.
    """
    words, listed = [word.strip() for word in names.split(",")], list(cases)
    assert listed, names

    def as_one(test: Test) -> Test:
        @wraps(test)
        def run_all(**fixtures: Any) -> None:
            failed: list[str] = []
            for case in listed:
                arguments = dict(zip(words, case if len(words) > 1 else [case], strict=True))
                try:
                    test(**arguments, **fixtures)
                except Exception as error:
                    failed.append(f"{case}: {type(error).__name__}: {error}")
            if failed:
                pytest.fail(f"{len(failed)} of {len(listed)} fail\n" + "\n".join(failed), False)

        signature = inspect.signature(test)
        fixture_parameters = [p for name, p in signature.parameters.items() if name not in words]
        run_all.__signature__ = signature.replace(parameters=fixture_parameters)  # type: ignore[attr-defined]
        return run_all

    return as_one
