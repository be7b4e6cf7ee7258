"""The statistics of a stream agree with what happened in it."""

import json
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import Session
from tactograph.nodes.stream.touch import LiveState
from tactograph.rings.live.nodes.view import live_statistics as module
from tactograph.rings.live.nodes.view.live_statistics import Statistics

STILL = np.zeros((12, 16), np.float32)


@pytest.fixture(autouse=True)
def warm(monkeypatch: pytest.MonkeyPatch) -> None:
    """Count from the first height on."""
    monkeypatch.setattr(module, "WARM_UP_S", 0.0)


def test_latency_is_from_the_exposures_end_until_now() -> None:
    statistics = Statistics()
    for late in [0.02] * 98 + [0.3] * 2:
        statistics.take(STILL, time.monotonic() - late, LiveState(), None)
    figures = statistics.figures()
    assert figures["heights"] == 100
    assert 0 < figures["processor_ms_per_height"] < 100
    assert figures["latency_median_ms"] == pytest.approx(20, abs=2)
    assert figures["latency_99_percent_ms"] == pytest.approx(300, abs=5)


def test_the_error_is_printed_where_the_truth_is_known() -> None:
    statistics = Statistics()
    statistics.take(STILL, time.monotonic(), LiveState(), STILL + np.float32(0.003))
    statistics.take(STILL, time.monotonic(), LiveState(), STILL + np.float32(0.004))
    figures = statistics.figures()
    assert figures["rmse_um"] == pytest.approx(np.sqrt((9 + 16) / 2), rel=1e-3)
    assert figures["worst_rmse_um"] == pytest.approx(4, rel=1e-3)
    assert "rmse_um" not in Statistics().figures()


def test_faults_and_settings_are_in_the_result_when_the_stream_ends(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    state = LiveState(9, 5, 2, Counter(swapped=3), {"rate": 30.0})
    session = Session()
    engine = {"folder": tmp_path / "new", "session": session, "provenance": None}
    for _ in range(3):
        module.live_statistics(STILL, time.monotonic(), state, None, **engine)
    session.close()
    result = json.loads((tmp_path / "new" / "result.json").read_text())
    assert result["settings"] == {"rate": 30.0}
    assert result["metrics"]["dropped"] == 2
    assert result["metrics"]["faults/swapped"] == 3
    assert "heights_per_s" in capsys.readouterr().out


def test_doubtful_heights_are_counted_and_reported(capsys: pytest.CaptureFixture[str]) -> None:
    statistics, unjudged = Statistics(every_s=1e-9), Statistics()
    for trust in (0.94, 0.003, 0.5, 0.007, 0.9):  # the first begins the time between two lines
        judged = {"contacts": 0.0, "trust": trust}
        statistics.take(STILL, time.monotonic(), LiveState(), None, contact=judged)
    assert statistics.figures()["doubtful_percent"] == 40
    doubted = ["doubtful" in line for line in capsys.readouterr().out.splitlines()]
    assert doubted == [True, False, True, False]
    for contact in ({"contacts": 0.0}, None):
        unjudged.take(STILL, time.monotonic(), LiveState(), None, contact=contact)
    assert unjudged.figures().get("doubtful_percent", 0.0) == 0


def test_contacts_are_counted_and_the_newest_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    statistics = Statistics(every_s=1e-9)
    touch = {
        "contacts": 2.0, "contact_area_mm2/c1": 3.0, "contact_depth_mm/c1": 0.2,
        "contact_area_mm2/c2": 1.5, "contact_depth_mm/c2": 0.41,
    }  # fmt: skip
    none = {"contacts": 0.0}
    for contact in (touch, touch, none, none):
        statistics.take(STILL, time.monotonic(), LiveState(), None, contact=contact)
    figures = statistics.figures()
    assert figures["touched_percent"] == 50
    assert figures["deepest_contact_mm"] == 0.41
    printed = capsys.readouterr().out.splitlines()
    assert "2 contacts, 0.41 mm deep" in printed[0]
    assert "contact" not in printed[-1]
    assert "touched_percent" not in Statistics().figures()
