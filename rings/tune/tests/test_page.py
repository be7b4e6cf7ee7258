"""The page in a real browser, by what a person does."""

import os
import shutil
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from rings.tune.tests.browser import Browser
from tactograph.graph.files.read_graph import read_graph
from tests.fixtures import Calibration, Raytraced

# Beside other tests a browser is late: its pictures, and its answers to clicks.
pytestmark = pytest.mark.realtime

VARIANT = """\
format: 1
extends: paper
title: Under test
patch:
  - set: shadow
    with: {threshold: 3.5}
"""
SAVED = """\
format: 1
extends: mine.yaml
title: Under test, tuned
patch:
  - set: shadow
    with: {threshold: 4.5}
  - backend: shadow
    to: numpy
"""


class Page(NamedTuple):
    """A page that is served, and the browser that shows it."""

    browser: Browser
    address: str
    folder: Path


def element(name: str) -> str:
    return f"[data-testid={name}]"


def drawn(name: str) -> str:
    """Whether a picture has come there."""
    return f"document.querySelector('{element(name)} img')?.naturalWidth > 100"


THRESHOLD = f"document.querySelector('{element('param-threshold-text')}')"


@pytest.fixture(scope="module")
def page(
    raytraced: Raytraced, calibration: Calibration, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Page]:
    folder = tmp_path_factory.mktemp("tuned")
    for name in ("cat", "sphere"):
        shutil.copytree(raytraced / "near33" / "cat", folder / "captures" / name)
    (folder / "mine.yaml").write_text(VARIANT)
    words = ["mine.yaml", "capture=captures", f"calibration={calibration('near33')}"]
    server = subprocess.Popen(
        [sys.executable, "-m", "tactograph.graph.command", "tune", *words, "--no-browser"],
        stdout=subprocess.PIPE,
        text=True,
        cwd=folder,
        # NiceGUI behaves differently below pytest.
        env={name: value for name, value in os.environ.items() if "PYTEST" not in name},
    )
    address = server.stdout.readline().strip()
    browser = Browser(folder / "profile")
    try:
        _until_served(address)
        browser.open(address)
        browser.wait(f"document.querySelector('{element('graph')} [data-node]') !== null", 60)
        # The page is there before its connection is; a picture comes through that.
        browser.wait(drawn("picture"), 60)
        yield Page(browser, address, folder)
    finally:
        browser.close()
        server.terminate()
        server.wait(timeout=30)
        server.stdout.close()


def _until_served(address: str) -> None:
    for _ in range(400):
        try:
            urllib.request.urlopen(address, timeout=5).close()
            return
        except (urllib.error.URLError, ConnectionError):
            time.sleep(0.05)
    raise AssertionError("the page is not served")


def text_of(page: Page, name: str) -> str:
    return page.browser.text(name)


def wait_for(page: Page, name: str, words: str) -> None:
    script = f"(document.querySelector('{element(name)}')?.innerText ?? '').includes('{words}')"
    page.browser.wait(script)


def choose(page: Page, node: str) -> None:
    if text_of(page, "node") == node:
        return
    page.browser.click(f'[data-node="{node}"] rect')
    page.browser.wait(f"document.querySelector('{element('node')}')?.innerText === '{node}'")


def pick(page: Page, name: str, option: str) -> None:
    """Open a list and choose one of its lines."""
    field = f"document.querySelector('{element(name)}')?.closest('.q-field')"
    line = f"[...document.querySelectorAll('.q-item')].find(e => e.innerText.trim() === '{option}')"
    chosen = f"({field}?.innerText ?? '').includes('{option}')"
    page.browser.click_until(element(name), chosen, then=f"{line}?.click()")


def test_the_page_shows_the_graph_its_result_and_figures(page: Page) -> None:
    wait_for(page, "figures", "rmse px")
    nodes = "[...document.querySelectorAll('[data-node]')].map(e => e.dataset.node)"
    assert {"light", "shadow", "slope", "integrate"} <= {*page.browser.look(nodes)}
    times = page.browser.look(f"document.querySelector('{element('graph')}').textContent")
    assert "refine_taylor" in times
    assert " ms" in times
    page.browser.wait(drawn("picture"))


def test_the_value_under_the_cursor_is_shown(page: Page) -> None:
    page.browser.hover(f"{element('picture')} img", 0.5, 0.5)
    wait_for(page, "value", " mm")
    assert "x " in text_of(page, "value")


def test_a_click_on_a_node_shows_its_description_and_outputs(page: Page) -> None:
    choose(page, "slope")
    wait_for(page, "inside-text", "mm/mm")
    page.browser.wait(drawn("inside"))
    page.browser.hover(f"{element('inside')} img", 0.25, 0.5)
    wait_for(page, "inside-value", "mm/mm")


def test_a_slider_is_moved_and_the_result_follows(page: Page) -> None:
    choose(page, "shadow")
    page.browser.wait(drawn("inside"))
    picture = f"document.querySelector('{element('picture')} img').src"
    followed = f"{picture} !== `{page.browser.look(picture)}` && parseFloat({THRESHOLD}.value) > 5"
    places = [0.29, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]
    page.browser.drag(element("param-threshold"), places, hold=followed)


def test_a_half_typed_value_survives_a_refresh(page: Page) -> None:
    choose(page, "shadow")
    page.browser.look(f"{THRESHOLD}.focus(), {THRESHOLD}.select()")
    page.browser.insert("4.")
    (page.folder / "mine.yaml").write_text(VARIANT.replace("threshold: 3.5", "treshold: 3.5"))
    wait_for(page, "error", "mine.yaml:6:12")
    assert page.browser.look(f"{THRESHOLD}.value") == "4."
    (page.folder / "mine.yaml").write_text(VARIANT)
    page.browser.wait(f"document.querySelector('{element('error')}').innerText === ''")
    # Another graph draws its fields anew: text typed before would be lost.
    page.browser.wait(f"{THRESHOLD}.value === '3.5'")


def test_a_wrong_value_is_reported_and_changes_nothing(page: Page) -> None:
    choose(page, "shadow")
    page.browser.type(f"input{element('param-threshold-text')}", "-1")
    page.browser.wait("document.body.innerText.includes('should be greater than 0')")
    assert text_of(page, "error") == ""


def test_a_back_end_is_switched_and_all_is_saved(page: Page) -> None:
    choose(page, "shadow")
    page.browser.type(f"input{element('param-threshold-text')}", "4.5")
    pick(page, "backend", "numpy")
    wait_for(page, "inside-text", "on numpy")
    page.browser.wait("document.body.innerText.includes('section along')")
    page.browser.wait(f"document.querySelector('{element('section')} polyline') !== null")
    page.browser.click(element("save"))
    page.browser.wait(f"document.querySelector('{element('file')}') !== null")
    page.browser.type(f"input{element('file')}", "saved.yaml")
    saved_now = "document.body.innerText.includes('saved and checked')"
    page.browser.click_until(element("write"), saved_now)
    assert (page.folder / "saved.yaml").read_text() == SAVED
    saved = read_graph(page.folder / "saved.yaml").nodes["shadow"]
    assert (saved.backend, saved.settings["threshold"]) == ("numpy", 4.5)


def test_the_next_capture_comes_and_the_one_before_comes_back(page: Page) -> None:
    # A dialog that closes takes the clicks meanwhile.
    page.browser.wait("document.querySelector('.q-dialog') === null")
    page.browser.click(element("next"))
    wait_for(page, "capture", "sphere")
    page.browser.click(element("previous"))
    wait_for(page, "capture", "cat")


def test_the_file_may_be_edited_meanwhile(page: Page) -> None:
    (page.folder / "mine.yaml").write_text(VARIANT.replace("threshold: 3.5", "treshold: 3.5"))
    wait_for(page, "error", "mine.yaml:6:12")
    assert "did you mean" in text_of(page, "error")
    page.browser.wait(drawn("picture"))
    (page.folder / "mine.yaml").write_text(VARIANT.replace("3.5", "6.5"))
    choose(page, "shadow")
    page.browser.wait(f"{THRESHOLD}.value === '6.5'")
    page.browser.wait(f"document.querySelector('{element('error')}').innerText === ''")


def test_nobody_else_reaches_the_page(page: Page) -> None:
    bare = page.address.partition("?")[0]
    for address, headers in (
        (bare, {}),
        (f"{bare}?token=guess", {}),
        (page.address, {"Host": "evil.example"}),
        (page.address, {"Origin": "http://evil.example"}),
    ):
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=10)


def test_the_page_fetches_nothing_from_other_hosts(page: Page) -> None:
    fetched = page.browser.look("performance.getEntriesByType('resource').map(e => e.name)")
    assert fetched
    here = page.address.partition("?")[0]
    assert [name for name in fetched if not name.startswith((here, "data:", "blob:"))] == []
