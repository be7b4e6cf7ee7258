"""Figures beside plots can be read: each has a line, and none lies over a plot or off the page."""

from pathlib import Path

import pytest
from matplotlib.figure import Figure
from pydantic import TypeAdapter

from tactograph.nodes.drawing.new_picture import NewPicture

FIGURES = {f"near_light_residual_percent{k}": -1.23456 * k for k in range(30)}


@pytest.mark.parametrize("layout", ["constrained", None])
def test_figures_stand_beside_the_plots(layout: str | None, tmp_path: Path) -> None:
    page = Figure(figsize=(13, 8), dpi=100, layout=layout)  # type: ignore[arg-type]
    if layout is None:
        page.subplots_adjust(right=0.72)
    plots = page.subplots(2, 2).flat
    NewPicture(tmp_path / "page.png").write(page, FIGURES, 0.9)
    (text,) = page.texts
    assert text.get_text().splitlines()[2].split() == ["near_light_residual_percent2", "-2.469"]
    place = text.get_window_extent()
    assert place.y0 > 0
    assert place.x1 < page.bbox.x1
    assert all(plot.get_tightbbox().x1 < place.x0 for plot in plots)


def test_a_place_that_cannot_be_written_to_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = TypeAdapter(NewPicture.__annotations__["file"])
    assert place.validate_python(tmp_path / "new" / "cal.npz")
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(ValueError, match="file is no folder that can be written to"):
        place.validate_python(tmp_path / "file" / "cal.npz")
    monkeypatch.setattr("os.access", lambda path, mode: False)
    with pytest.raises(ValueError, match="is no folder that can be written to"):
        place.validate_python(tmp_path / "new" / "cal.npz")
