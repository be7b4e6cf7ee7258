"""Names in order, with and without the answers that an earlier process kept."""

import sys
from pathlib import Path

import pytest

from tactograph.graph.disk import disk_cache
from tactograph.graph.plan.before import classes_of, find_cycle, in_order, with_all_before

BEFORE = {"end": {"left", "right"}, "left": {"start"}, "right": {"start"}, "alone": set()}


def answers() -> tuple[object, ...]:
    of = classes_of("abcd", [("a", "c"), ("c", "d")])
    return (
        in_order(BEFORE, lambda name: (name != "right", name)),
        with_all_before(BEFORE, ["left"]),
        find_cycle(BEFORE),
        find_cycle({"a": {"b"}, "b": {"a"}})[1:],
        {frozenset(n for n in of if of[n] == first) for first in of.values()},
    )


def test_a_graph_is_planned_again_without_networkx(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(disk_cache.FOLDER_VARIABLE, "off")
    expected = answers()
    order, before_left, cycle, _, classes = expected
    assert order == ["alone", "start", "right", "left", "end"]
    assert (before_left, cycle) == ({"left", "start"}, [])
    assert classes == {frozenset("acd"), frozenset("b")}
    monkeypatch.setenv(disk_cache.FOLDER_VARIABLE, str(tmp_path))
    assert answers() == expected
    for name in [name for name in sys.modules if name.startswith("networkx")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(sys.modules, "tactograph.graph.plan._walks")
    monkeypatch.setitem(sys.modules, "networkx", None)
    assert answers() == expected
