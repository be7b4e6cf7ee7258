"""Ctrl-C ends a command in one line, wherever it comes."""

import importlib
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tactograph import ctrl_c
from tests.fixtures import python


@pytest.fixture
def listening() -> Iterator[None]:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    ctrl_c.listen()
    yield
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_waits_for_the_end_of_an_import(
    listening: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "import signal\nsignal.raise_signal(signal.SIGINT)\nis_complete = True\n"
    (tmp_path / "interrupted.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012  (it may come in either line)
        assert importlib.import_module("interrupted").is_complete
        time.sleep(60)
    assert sys.modules.pop("interrupted").is_complete


def test_an_import_that_never_ends_is_still_interrupted(
    listening: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "import signal, time\nsignal.raise_signal(signal.SIGINT)\ntime.sleep(60)\n"
    (tmp_path / "endless.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(ctrl_c, "PATIENCE_S", 0.1)
    with pytest.raises(KeyboardInterrupt):
        importlib.import_module("endless")


def test_ctrl_c_acts_at_once_where_nothing_is_imported(listening: None) -> None:
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_ctrl_c_during_the_import_of_the_command_line_ends_in_one_line() -> None:
    code = (
        "import signal, sys\n"
        "class Interrupting:\n"
        "    def find_spec(name, *_):\n"
        "        if name == 'click': signal.raise_signal(signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupting)\n"
        "from tactograph.__main__ import main\n"
        "main()"
    )
    assert python("-c", code, code=130).stderr == "tactograph: stopped\n"
