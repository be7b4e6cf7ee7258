"""Names in order."""

from tactograph.graph.plan.before import classes_of, find_cycle, in_order, with_all_before

BEFORE = {"end": {"left", "right"}, "left": {"start"}, "right": {"start"}, "alone": set()}


def test_a_name_stands_behind_all_before_it_and_else_by_rank() -> None:
    assert in_order(BEFORE) == ["alone", "start", "left", "right", "end"]
    order = in_order(BEFORE, lambda name: (name != "right", name))
    assert order == ["alone", "start", "right", "left", "end"]


def test_all_that_comes_before_is_found_through_loops_too() -> None:
    assert with_all_before(BEFORE, ["left"]) == {"left", "start"}
    assert with_all_before({"a": {"b"}, "b": {"a"}, "c": set()}, ["a"]) == {"a", "b"}


def test_a_cycle_leads_from_a_name_back_to_it() -> None:
    assert find_cycle(BEFORE) == []
    first, *others = find_cycle({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}})
    assert others[-1] == first
    assert {*others} == {"a", "b", "c"}


def test_a_class_of_names_is_called_by_one_of_them() -> None:
    of = classes_of("abcde", [("a", "c"), ("e", "d"), ("c", "d"), ("d", "a")])
    assert of["b"] == "b"
    assert {of[name] for name in "acde"} == {of["a"]} < {*"acde"}
