"""The page's elements, without a browser: what they hold, and that two browsers see the same."""

from pathlib import Path

import pytest

from rings.tune.tests.conftest import GRAPH, Open, settled
from tactograph.rings.tune.tuning import Tuning

pytest.importorskip("nicegui", reason="'make test-all' installs it")
from nicegui import Client, ui
from nicegui.page import page

from tactograph.rings.tune.page import Page

pytestmark = pytest.mark.slow
HOSTILE = 'x" autofocus onfocus="alert(1)" data-y="'
ATTRIBUTES = {"value", "data-testid"}


class Seen:
    """A page, and its elements by the name that tests know them by."""

    def __init__(self, tuning: Tuning) -> None:
        self.client = Client(page("/"))
        with self.client:
            self.page = Page(tuning)

    def choose(self, node: str) -> None:
        with self.client:
            self.page.choose(node)

    def look(self) -> None:
        """Act as the page's timers do."""
        with self.client:
            self.page.take_up(settled(self.page.tuning))
            self.page.take_up_late()

    def click(self, name: str) -> None:
        with self.client:
            for listener in self.element(name)._event_listeners.values():
                if listener.handler is not None:
                    listener.handler(None)

    def element(self, name: str) -> ui.element:
        return next(
            element
            for element in reversed([*self.client.elements.values()])
            if element.props.get("data-testid") == name
        )


def test_a_value_is_text_whatever_quotes_it_holds(opened: Open) -> None:
    graph = f"""
format: 1
nodes:
  frames: {{op: read_capture, with: {{folder: {HOSTILE!r}}}}}
outputs: {{light: frames.image}}
"""
    seen = Seen(opened(graph))
    seen.choose("frames")
    field = seen.element("param-folder-text")
    assert field.props["value"] == HOSTILE
    assert {*field.props} == ATTRIBUTES


def test_two_browsers_show_the_same_node_and_values(tuning: Tuning) -> None:
    one, two = Seen(tuning), Seen(tuning)
    one.choose("fail")
    two.choose("high")
    for seen in (one, two):
        seen.look()
    assert one.element("node").text == "high"
    tuning.set("high", "above", 5.0)
    for seen in (one, two):
        seen.look()
        assert seen.element("param-above-text").props["value"] == "5"
    file = Path(tuning.source)
    file.write_text(GRAPH.replace("{image: twice}}\n  fail", "{image: seen}}\n  fail"))
    for seen in (one, two):
        seen.look()
        assert seen.element("param-above-text").props["value"] == "1.5"


def test_a_foreign_file_stays(tuning: Tuning, tmp_path: Path) -> None:
    tuning.set("high", "above", 5.0)
    theirs, mine = tmp_path / "theirs.yaml", tmp_path / "mine.yaml"
    theirs.write_text("theirs: 1\n")
    seen = Seen(tuning)
    seen.click("save")
    for file in (theirs, mine):
        seen.element("file").set_value(str(file))
        seen.click("write")
    assert theirs.read_text() == "theirs: 1\n"
    assert "extends" in mine.read_text()
