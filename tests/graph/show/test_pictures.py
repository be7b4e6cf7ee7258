"""Pictures of a comparison's report, as a page or a paper shows them."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.figure import Figure

from tactograph.graph.show import pictures
from tactograph.graph.show.figures import Estimate


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Figures that were drawn."""
    figures: list[Figure] = []
    ordinary = pictures._svg
    monkeypatch.setattr(pictures, "_svg", lambda each: figures.append(each) or ordinary(each))
    return figures


@pytest.mark.parametrize("ends_mm", [(-0.012, 0.039), (-0.001, 0.003), (-120, 300)])
def test_no_label_of_a_section_is_cut(drawn: list[Figure], ends_mm: tuple[float, float]) -> None:
    truth = np.tile(2 * np.sin(np.linspace(0, 3, 90)), (2, 1))
    run = truth + np.linspace(*ends_mm, 90)
    pictures.draw_section({"truth": truth, "paper_no_shadow": run}, "height / mm", 0, "truth")
    (figure,) = drawn
    for axes in figure.axes:
        assert axes.yaxis.label.get_window_extent().x0 > -1  # px


@pytest.mark.parametrize(("last", "count"), [(8.0, 4), (8.0, 1), (1e-3, 20)])
def test_no_labels_of_a_logarithmic_sweep_overlap(
    drawn: list[Figure], last: float, count: int
) -> None:
    values = np.geomspace(1, last, count).tolist()
    curve = values, [Estimate(value, value, value, 1) for value in values]
    figures = ("rmse_um", "rmse_px", "max_error_um")
    pictures.draw_curves({name: {"paper": curve} for name in figures}, "shadow.threshold", log=True)
    (figure,) = drawn
    for axes in figure.axes:
        labels = [*axes.xaxis.get_majorticklabels(), *axes.xaxis.get_minorticklabels()]
        boxes = [each.get_window_extent() for each in labels if each.get_text()]
        assert boxes
        assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
