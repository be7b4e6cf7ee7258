"""Pictures of a comparison's report, as a page or a paper shows them."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from tactograph.graph.show import pictures


@pytest.mark.parametrize("ends_mm", [(-0.012, 0.039), (-0.001, 0.003), (-120, 300)])
def test_no_label_of_a_section_is_cut(
    monkeypatch: pytest.MonkeyPatch, ends_mm: tuple[float, float]
) -> None:
    drawn: list[Figure] = []
    monkeypatch.setattr(pictures, "_uri", lambda *_: "")
    ordinary = pictures._svg
    monkeypatch.setattr(pictures, "_svg", lambda figure: drawn.append(figure) or ordinary(figure))
    truth = np.tile(2 * np.sin(np.linspace(0, 3, 90)), (2, 1))
    run = truth + np.linspace(*ends_mm, 90)
    pictures.draw_section({"truth": truth, "paper_no_shadow": run}, "height / mm", 0, "truth")
    (figure,) = drawn
    for axes in figure.axes:
        assert axes.yaxis.label.get_window_extent().x0 > -1  # px
