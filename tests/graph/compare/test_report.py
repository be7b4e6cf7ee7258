"""The comparison as a user makes it, and its page as a browser shows it."""

import errno
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from unittest.mock import Mock

import cv2
import numpy as np
import pytest

from tactograph.graph.command import run_command
from tactograph.graph.compare.differences import Difference, differences
from tactograph.graph.compare.report import _panels, _pictures
from tactograph.graph.compare.stored_views import load_views, save_views
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.show.views import View
from tests.fixtures import MadeOnce
from tests.graph.conftest import Command, Write, one_line

ONE = """
format: 1
title: A ball <under> four lights & noise
prefer: [numpy]
nodes:
  shape:  {op: shape_ball, with: {radius_mm: 0.8, width_px: 48, height_px: 40}}
  lights: {op: light_ring}
  scene:  {op: render, in: {height: shape.height, pixel: shape.pixel_size, lights: lights}}
  camera: {op: expose, in: {light: scene.light}, with: {seed: 5}}
  shadow: {op: label_lit, in: {light: camera.image}}
  slope:  {op: height_slopes, in: {height: shape.height, pixel: shape.pixel_size}}
  height: {op: integrate_dct, in: {slope: slope.slope, pixel: shape.pixel_size}}
  labels: {op: evaluate_shadow, in: {shadow: shadow, truth: scene.labels}}
  error:  {op: evaluate_height, in: {height: height, pixel: shape.pixel_size, truth: shape.height}}
  score:  {op: join_metrics, in: {height: error, shadow: labels}}
outputs:
  image: camera.image
  truth: shape.height
  truth_shadow: scene.labels
  shadow: shadow
  height: height
  metrics: score
"""
TWO = """
format: 1
extends: one.yaml
title: Another integrator
patch:
  - replace: height
    op: integrate_frankot_chellappa
"""
OVER = """
format: 1
params:
  capture: {kind: path}
  out:     {kind: path, default: out}
prefer: [numpy]
nodes:
  frames: {op: read_capture, with: {folder: $capture}}
  lit:    {op: label_lit, in: {light: frames.image}}
  score:  {op: evaluate_shadow, in: {shadow: lit, truth: frames.truth_shadow}}
outputs: {shadow: lit, metrics: score}
"""
SWEEP = ("--sweep", "camera.full_well=log:100..10000:2", "--seed", "camera.seed", "--repeats", 2)
EXAMINE = """<script>addEventListener("load", () => {
  const images = [...document.images];
  document.title = JSON.stringify({
    images: images.length,
    broken: images.filter(i => !i.complete || !i.naturalWidth).length,
    tooWide: document.documentElement.scrollWidth > innerWidth,
    hidden: images.filter(i => !i.getBoundingClientRect().height).length,
    height: document.body.scrollHeight,
  });
});</script>"""


class _References(HTMLParser):
    """Everything that a page would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [
            v or "" for k, v in attrs if k in ("src", "href", "srcset", "data", "action")
        ]


def compared(made_once: MadeOnce, name: str, tmp_path: Path, *words: object) -> Path:
    """A copy of a comparison that is run once for all tests of all workers."""

    def make(folder: Path) -> None:
        folder.mkdir()
        for file, text in (("one.yaml", ONE), ("two.yaml", TWO)):
            (folder / file).write_text(text)
        graphs = (folder / "one.yaml", folder / "two.yaml")
        run_command([str(w) for w in ("compare", *graphs, *words, "--out", folder / "report")])

    shutil.copytree(made_once(name, make) / "report", tmp_path / "report")
    return tmp_path / "report"


@pytest.fixture
def report(made_once: MadeOnce, tmp_path: Path) -> Path:
    """The report of both variants."""
    return compared(made_once, "compared", tmp_path)


@pytest.fixture
def swept(made_once: MadeOnce, tmp_path: Path) -> Path:
    """The report of both variants at two exposures, each twice."""
    return compared(made_once, "swept", tmp_path, *SWEEP)


@pytest.fixture
def captures(tmp_path: Path) -> list[Path]:
    rng = np.random.default_rng(0)
    folders = [tmp_path / name for name in ("left", "right")]
    for folder in folders:
        folder.mkdir()
        images = rng.integers(0, 255, (4, 12, 16)).astype(np.uint8)
        labels = np.zeros((12, 16), np.uint8)
        for k, image in enumerate(images):
            image[:3, :4] = 0
            labels |= ((image == 0) << k).astype(np.uint8)
            cv2.imwrite(str(folder / f"led{k + 1}.png"), image)
        cv2.imwrite(str(folder / "truth_shadow.png"), labels)
    return folders


def change_truth(capture: Path) -> None:
    truth = cv2.imread(str(capture / "truth_shadow.png"), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(capture / "truth_shadow.png"), truth ^ 1)


def chromium(*words: object) -> subprocess.CompletedProcess[str]:
    """Run the browser; without one the test fails, it is not skipped."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    assert browser, "chromium is missing; tests/install_system.sh installs it"
    safe = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage")
    quiet = ("--enable-logging=stderr", "--v=0", "--host-resolver-rules=MAP * ~NOTFOUND")
    return subprocess.run(
        [browser, *safe, *quiet, *map(str, words)], capture_output=True, text=True, timeout=60
    )


def rows_of(folder: Path) -> list[dict[str, object]]:
    return json.loads((folder / "table.json").read_text())


@pytest.mark.slow
def test_a_browser_shows_the_complete_page(swept: Path, tmp_path: Path) -> None:
    page = (swept / "report.html").read_text(encoding="utf-8")
    references = _References()
    references.feed(page)
    assert references.addresses
    assert all(reference.startswith("data:") for reference in references.addresses)
    assert not re.search(r"@import|url\(|<script", page)

    examined = tmp_path / "examined.html"
    examined.write_text(page.replace("</body>", f"{EXAMINE}</body>"), encoding="utf-8")
    shown = chromium("--window-size=1300,900", "--dump-dom", examined.as_uri())
    assert "CONSOLE" not in shown.stderr
    title = re.search(r"<title>(.*?)</title>", shown.stdout)
    assert title
    state = json.loads(title[1].replace("&quot;", '"'))
    # One sweep picture; of the runs: images, labels, heights, errors, section.
    assert state["images"] == 6
    assert (state["broken"], state["hidden"], state["tooWide"]) == (0, 0, False)
    assert state["height"] > 2000


@pytest.mark.slow
def test_the_page_is_not_blank(report: Path, tmp_path: Path) -> None:
    picture, page = tmp_path / "page.png", report / "report.html"
    chromium(f"--screenshot={picture}", "--window-size=1300,2400", page.as_uri())
    pixels = cv2.imread(str(picture))
    assert pixels.shape[1] == 1300
    assert (pixels < 128).mean() > 0.01
    assert len(np.unique(pixels @ np.array([1, 256, 65536]))) > 1000


def test_the_page_names_the_ablated_node_and_the_hash_of_each_graph(
    report: Path, write: Write
) -> None:
    page = (report / "report.html").read_text(encoding="utf-8")
    graphs = write(ONE, "one.yaml"), write(TWO, "two.yaml")
    texts = (
        "integrate_frankot_chellappa",
        "How it was made",
        "&lt;under&gt; four lights &amp; noi",
    )
    for text in (*texts, *(read_graph(graph).hash for graph in graphs)):
        assert text in page


@pytest.mark.slow
def test_repeats_by_seed_give_intervals(swept: Path) -> None:
    rows = rows_of(swept)
    assert len(rows) == 2 * 2 * 2
    assert {row["seed"] for row in rows} == {5, 6}
    assert len({row["hash"] for row in rows}) == len(rows)
    assert "±" in (swept / "table.md").read_text()


def test_a_run_is_not_repeated_until_its_capture_changes(
    about: Command, captures: list[Path], tmp_path: Path
) -> None:
    words = ("compare", OVER, "--over", captures[0], captures[1], "--out", tmp_path / "r")
    assert "there already" not in about(*words).err
    assert "2 of 2 runs were there already" in about(*words).err
    before = rows_of(tmp_path / "r")
    change_truth(captures[0])
    assert "1 of 2 runs were there already" in about(*words).err
    after = rows_of(tmp_path / "r")
    assert after[0]["figures"] != before[0]["figures"]
    assert after[1] == before[1]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("paper",), "give --over DIR"),
        (("paper", "--over", "nowhere"), "'nowhere' does not exist"),
        (("table1", "--repeats", 3), "--repeats needs --seed node.param"),
        (("table1", "--sweep", "lights.slant=1,2"), "has no parameter 'slant'"),
        (("table1", "--sweep", "lights.slant_deg=1"), "at least two values"),
        (("table1", "--seed", "camera.sed"), "has no parameter 'sed'"),
        (("table1", "--seed", "camera.seed", "--sweep", "camera.seed=1,2"), "only once"),
    ],
)
def test_a_wrong_comparison_is_refused_in_one_line(
    tactograph: Command, words: tuple[object, ...], message: str
) -> None:
    assert message in one_line(tactograph("compare", *words))


def test_differences_are_listed_by_box() -> None:
    base = read_graph("paper")
    assert differences(base, base) == {}
    assert differences(base, read_graph("paper_no_shadow")) == {
        "shadow": [Difference("shadow", "taken out", "no", "yes, by its neutral value")]
    }
    changes = differences(base, read_graph("reconstruct"))
    assert len(changes) < 30 < 100 < sum(map(len, changes.values()))
    assert {change.change for change in changes["rough"]} == {"added"}
    assert {change.change for change in changes["look_up"]} == {"removed"}
    assert Difference("slope", "op", "refine_taylor", "pixel_mean_slope") in changes["slope"]
    without = differences(base, read_graph("paper_no_flat"))
    raw = Difference("integrate.raw", "op", "integrate_frankot_chellappa", "integrate_dct")
    assert raw in without["integrate"]
    assert Difference("take.film", "input flat", "take.cal.flat", "smooth") in without["take"]


def test_an_empty_map_and_labels_that_are_empty_in_all_runs_are_not_drawn() -> None:
    unknown = np.full((4, 5), np.nan, np.float32)
    some = np.where(np.arange(20).reshape(4, 5) > 9, np.float32(1), unknown)
    for name, kind, empty, full in (
        ("height", "map", unknown, some),
        ("highlight", "labels", np.zeros((4, 5), np.uint8), np.eye(4, 5, dtype=np.uint8)),
    ):
        runs = {"one": {name: View(name, kind, "", empty)}}
        assert _pictures(runs) == []
        assert _pictures(runs | {"two": {name: View(name, kind, "", full)}})
    truth = {"truth_height": View("truth_height", "map", "mm", some)}
    height = {"height": View("height", "map", "mm", unknown)}
    assert _pictures({"one": height | truth, "two": {"height": View("height", "map", "mm", some)}})


def test_runs_with_equal_results_and_truths_share_one_panel() -> None:
    flat, ball = (np.full((4, 5), level, np.float32) for level in (0, 1))

    def run(height: np.ndarray, truth: np.ndarray) -> dict[str, View]:
        named = {"height": height, "truth_height": truth}
        return {name: View(name, "map", "mm", array) for name, array in named.items()}

    runs = {
        "x 1": run(flat, flat),
        "x 2": run(flat, flat),
        "x 3": run(ball, flat),
        "x 4": run(flat, ball),
    }
    assert [*_panels("height", runs).errors] == ["x 1; 1 equal", "x 3", "x 4"]


def test_a_truncated_file_of_views_is_left_out_of_the_report(tmp_path: Path) -> None:
    save_views([View("height", "map", "mm", np.ones((40, 50), np.float32))], tmp_path)
    file = tmp_path / "views.npz"
    for length in (0, 10, file.stat().st_size // 2, file.stat().st_size - 4):
        file.write_bytes(file.read_bytes()[:length])
        assert load_views(tmp_path) == {}
        save_views([View("height", "map", "mm", np.ones((40, 50), np.float32))], tmp_path)


def test_a_full_disk_ends_the_comparison_in_one_line(
    tmp_path: Path, about: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    full = Mock(side_effect=OSError(errno.ENOSPC, "No space left on device"))
    monkeypatch.setattr("tactograph.graph.compare.compare.save_views", full)
    done = about("compare", ONE, "--out", tmp_path / "report")
    assert done.code == 2
    assert "cannot be written: No space left on device" in done.err
    assert not (tmp_path / "report" / "report.html").exists()
