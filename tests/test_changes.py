"""The changelog tells of the version, and entries for the next one are where they are found."""

import re
import tomllib

from tests.fixtures import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
TOWNCRIER = PROJECT["tool"]["towncrier"]
CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_changelog_tells_of_the_version() -> None:
    assert re.search(rf"^## .*\b{re.escape(PROJECT['project']['version'])}", CHANGELOG, re.M)


def test_new_entries_go_above_the_old_ones() -> None:
    head, start, entries = CHANGELOG.partition(TOWNCRIER["start_string"])
    assert start
    assert "\n## " not in head
    assert entries.lstrip().startswith("## ")


def test_an_entry_is_named_after_its_kind() -> None:
    kinds = "|".join(kind["directory"] for kind in TOWNCRIER["type"])
    names = {file.name for file in (ROOT / "changes").iterdir()} - {"README.md"}
    assert not [name for name in names if not re.fullmatch(rf"\+[a-z0-9_-]+\.({kinds})\.md", name)]
