"""Parameters of nodes: checked by their annotations before anything runs."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, strategies as st

from tactograph.graph import GraphError, InputError
from tactograph.graph.declare.check_settings import check_settings
from tactograph.graph.declare.find_node import find_node, shipped_nodes
from tactograph.graph.disk.strict_yaml import Place
from tactograph.graph.files.flat_graph import PARAM_PLACEHOLDER, Entry
from tests.each import each
from tests.graph.toys import choosy

ENTRY = Entry("choosy", places={"": Place("g.yaml", 3, 5, "nodes.c")})


def where(name: str) -> str:
    return ENTRY.where(f"with.{name}")


def check(**settings: Any) -> dict[str, Any]:
    return check_settings(choosy, {"way": "left", **settings}, where)


def refusal(**settings: Any) -> str:
    with pytest.raises(GraphError) as caught:
        check(**settings)
    return str(caught.value)


def test_defaults_are_filled_in_and_values_converted() -> None:
    defaults = {"way": "left", "share": None, "corner": (0, 0), "level": 1.0, "bright": False}
    assert check() == defaults
    assert check(level=2)["level"] == 2.0
    found = check_settings(find_node("read_height"), {"file": "a/b.npy"}, where)
    assert found["file"] == Path("a/b.npy")


@pytest.mark.parametrize("corner", [[3, 4], "3,4", (3, 4), "[3, 4]", " [3,4] "])
def test_a_tuple_may_be_a_list_or_words_with_commas(corner: Any) -> None:
    assert check(corner=corner)["corner"] == (3, 4)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"way": "up"}, "with.way: input should be 'left' or 'right', not 'up'"),
        ({"share": 0.6}, "with.share: input should be less than or equal to 0.5, not 0.6"),
        ({"share": True}, "with.share: a number is needed, not True"),
        ({"share": float("nan")}, "with.share: input should be a finite number, not nan"),
        ({"level": True}, "with.level: a number is needed, not True"),
        ({"level": "0,25"}, "with.level: a number is needed, such as 0.25 with a point"),
        ({"level": "much"}, "with.level: a number is needed, not 'much'"),
        ({"level": "1e-3"}, "with.level: a number is needed, not '1e-3'"),
        ({"level": "1_0.0"}, "with.level: a number is needed, not '1_0.0'"),
        ({"share": "0.1"}, "with.share: a number is needed, not '0.1'"),
        ({"bright": "no"}, "with.bright: true or false is needed, not 'no'"),
        ({"bright": 1}, "with.bright: true or false is needed, not 1"),
        ({"corner": ["1", 2]}, "with.corner: a number is needed"),
        ({"level": float("inf")}, "with.level: input should be a finite number, not inf"),
        ({"level": None}, "with.level: input should be a valid number"),
        ({"level": 10**400}, "with.level:"),
        ({"corner": [1]}, "with.corner: 2 values are needed, not [1]"),
        ({"corner": [True, 1]}, "with.corner: a number is needed"),
        ({"corner": "1,x"}, "integer, not 'x' at [1]"),
        ({"corner": [0.5, 1]}, "with.corner: input should be a valid integer"),
        ({"corner": 5}, "with.corner: input should be a valid tuple"),
        ({"shares": 0.1}, "node 'choosy' has no parameter 'shares'; did you mean 'share'?"),
    ],
)
def test_a_wrong_value_is_refused_with_its_place(settings: dict[str, Any], message: str) -> None:
    said = refusal(**settings)
    assert said.startswith("g.yaml:3:5: nodes.c.with.")
    assert message in said
    assert len(said) < 250


def test_a_missing_parameter_is_refused() -> None:
    with pytest.raises(GraphError, match="node 'choosy' needs the parameter 'way'"):
        check_settings(choosy, {}, where)


def test_a_pending_value_is_accepted_while_others_are_checked() -> None:
    assert check(way=PARAM_PLACEHOLDER)["way"] is PARAM_PLACEHOLDER
    assert check(way=PARAM_PLACEHOLDER, level=PARAM_PLACEHOLDER)["corner"] == (0, 0)
    assert "with.share" in refusal(way=PARAM_PLACEHOLDER, share=7)


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=6),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=4,
)


@given(
    st.sampled_from(["way", "share", "corner", "level", "bright", "x", "model_config", "__init__"]),
    VALUES,
)
def test_any_value_is_checked_or_refused(name: str, value: Any) -> None:
    try:
        found = check(**{name: value})
    except GraphError as error:
        assert "\n" not in str(error)  # noqa: PT017
    else:
        assert isinstance(found["level"], float)
        assert isinstance(found["bright"], bool)


@each("name", shipped_nodes())
def test_the_defaults_of_a_node_pass_its_own_check(name: str) -> None:
    node = find_node(name)
    needed = {n: PARAM_PLACEHOLDER for n, p in node.parameters.items() if p.required}
    check_settings(node, needed, where)
    defaults = {n: p.default for n, p in node.parameters.items() if not p.required}
    check_settings(node, {**needed, **defaults}, where)


def test_a_tilde_is_the_user_s_home(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    node = find_node("read_capture")
    for folder in ("~/touch", Path("~/touch")):
        assert check_settings(node, {"folder": folder}, where)["folder"] == tmp_path / "touch"
    assert check_settings(node, {"folder": "./~"}, where)["folder"] == Path("~")
    with pytest.raises(InputError, match="~nobody-of-that-name: there is no such user"):
        check_settings(node, {"folder": "~nobody-of-that-name"}, where)


def test_too_many_values_are_refused_in_plain_words() -> None:
    with pytest.raises(GraphError, match=r"at most 2 items, not \[0\.1, 0\.2, 0\.3\]$"):
        check_settings(find_node("pixel_size"), {"mm": [0.1, 0.2, 0.3]}, where)
