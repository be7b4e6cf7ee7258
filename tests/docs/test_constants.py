"""The page of constants agrees with the code, and each constant has a reason."""

import importlib.util
from pathlib import Path

import pytest

from tests.fixtures import needs_rings

ROOT = Path(__file__).parents[2]
SPEC = importlib.util.spec_from_file_location("constants", ROOT / "benchmarks" / "constants.py")
assert SPEC is not None
assert SPEC.loader is not None
constants = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(constants)


@needs_rings
def test_the_page_agrees_with_the_code() -> None:
    """`python benchmarks/constants.py --write` writes the page."""
    assert constants.PAGE.read_text() == constants.page()


@pytest.mark.parametrize("room", constants.ROOMS)
def test_a_constant_has_a_reason(room: str) -> None:
    files = {file for each in constants.ROOMS[room] for file in ROOT.glob(each)}
    bare = [each.names for file in files for each in constants.constants(file) if not each.reason]
    assert bare == []
