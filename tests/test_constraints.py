"""constraints.txt names a version of everything that the project needs, within its bounds."""

import re
import tomllib

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

from tests.fixtures import ROOT

UNTESTED = {"cpu", "lerobot"}
"""Extras that 'make test-all' does not install."""


def test_every_requirement_has_a_version_within_its_bounds_and_the_file_holds_nothing_else() -> (
    None
):
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    assert [x for x in lines if not re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.+!]+", x)] == []
    versions = {canonicalize_name(name): v for name, _, v in (x.partition("==") for x in lines)}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    tested = [word for name, words in extras.items() if name not in UNTESTED for word in words]
    for each in map(Requirement, [*project["dependencies"], *tested]):
        # An extra of extras; and pip does not list setuptools before Python 3.12.
        if each.name not in ("tactograph", "setuptools"):
            assert each.specifier.contains(versions[canonicalize_name(each.name)]), each


def test_the_oldest_set_holds_the_lower_bounds() -> None:
    """'make test-oldest' installs this set; 'make oldest' writes the file."""
    lines = (ROOT / "tests" / "oldest.txt").read_text().splitlines()
    versions = {canonicalize_name(name): v for name, _, v in (x.partition("==") for x in lines)}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    itself, *tools = extras["test"]
    requirements = [*project["dependencies"], *tools]
    requirements += [word for extra in Requirement(itself).extras for word in extras[extra]]
    for each in map(Requirement, requirements):
        low = next(s.version for s in each.specifier if s.operator == ">=")
        assert Version(versions[canonicalize_name(each.name)]) == Version(low), each
