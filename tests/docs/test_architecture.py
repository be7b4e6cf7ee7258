"""The page of the architecture names files that exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/architecture.md").read_text()
ROOMS = ("graph", "nodes", "kernels", "pipelines", "tests", "benchmarks", "tactograph", "rings")
FILES = {*ROOMS, "setup.py"} | {
    path.relative_to(ROOT).as_posix()
    for room in ROOMS
    for path in (ROOT / room).rglob("*")
    if not path.is_symlink()
}
NAMED = re.findall(r"`((?:\w+/)+\w*(?:\.\w+)?|\w+\.(?:py|yaml|clh))`", PAGE)


@pytest.mark.parametrize("named", sorted(set(NAMED)))
def test_a_file_that_the_page_names_exists(named: str) -> None:
    wanted = re.compile(rf"(^|/){re.escape(named.rstrip('/'))}(\.py|\.cl|\.yaml)?$")
    assert any(wanted.search(file) for file in FILES), f"docs/architecture.md: no {named}"


def test_the_page_names_files() -> None:
    assert len(NAMED) > 10
