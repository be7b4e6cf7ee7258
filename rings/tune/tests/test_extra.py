"""Without its packages the command names the extra."""

import sys

import pytest

from tests.graph.conftest import Command, one_line


def test_the_command_names_the_extra(tactograph: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nicegui", None)
    message = one_line(tactograph("tune", "paper"))
    assert message.endswith("tune needs nicegui: pip install 'tactograph[tune]'\n")
