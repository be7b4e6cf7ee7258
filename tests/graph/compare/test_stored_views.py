"""The views of a result, and the truth of each."""

import numpy as np

from tactograph.graph.compare.stored_views import find_truth
from tactograph.graph.show.views import Kind, View


def views(*names: str, kind: Kind = "map", unit: str = "mm") -> dict[str, View]:
    return {name: View(name, kind, unit, np.zeros((3, 4), np.float32)) for name in names}


def truths(maps: dict[str, View]) -> dict[str, str | None]:
    matches = {name: find_truth(view, maps) for name, view in maps.items() if not view.is_truth}
    return {name: view and view.name for name, view in matches.items()}


def test_a_truth_is_that_of_the_first_view_of_its_kind_and_unit_alone() -> None:
    maps = views("truth", "height", "error") | views("slope", unit="1")
    assert truths(maps) == {"height": "truth", "error": None, "slope": None}


def test_a_truth_that_names_a_view_is_the_truth_of_that_one() -> None:
    maps = views("truth_error", "truth", "height", "error")
    assert truths(maps) == {"height": "truth", "error": "truth_error"}
    labels = views("truth_shadow", "highlight", "shadow", kind="labels", unit="LED bits")
    assert truths(labels) == {"highlight": None, "shadow": "truth_shadow"}


def test_a_truth_of_another_size_is_ignored() -> None:
    maps = views("height") | {"truth": View("truth", "map", "mm", np.zeros((2, 2)))}
    assert truths(maps) == {"height": None}
