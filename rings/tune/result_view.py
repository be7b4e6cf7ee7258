"""The result on the page: one output as a picture, with a section through it."""

from html import escape
from typing import Any

import numpy as np
from nicegui import events, ui
from numpy.typing import NDArray

from tactograph.rings.tune.follow import Follow
from tactograph.rings.tune.picture_view import Pointed, ScaledPicture
from tactograph.rings.tune.pictures import draw, planes_of
from tactograph.rings.tune.tuning import Tuning
from tactograph.sdk import Result

LINE_COLOUR = "#1f5fa8"


class ResultView:
    """The card with the picture of an output."""

    def __init__(self, tuning: Tuning, follow: Follow) -> None:
        self._tuning, self._follow = tuning, follow
        self._output = ""
        self._row = 0.5
        with ui.column().classes("t-card gap-2").style("width: 57%; min-width: 0"):
            self._outputs = ui.select([], on_change=self._output_chosen)
            self._outputs.props("dense options-dense borderless data-testid=output")
            with ui.row().classes("w-full gap-2 no-wrap items-stretch"):
                self._image = ScaledPicture(follow, "picture", self._pressed)
                with ui.column().classes("gap-1").style("flex: 1 1 150px; min-width: 150px"):
                    self._image.add_value("value")
                    self._section = ui.html("", sanitize=False).classes("t-section w-full")
                    self._section.props("data-testid=section")

    def draw(self) -> None:
        """Draw the chosen output."""
        state = self._tuning.state
        if state.result is None:
            return
        self._offer_outputs(state.result)
        array = _plane(state.result, self._output)
        if array is None:
            return
        unit = state.result.plan.port(self._output).unit
        height, width = array.shape
        row = int(self._row * (height - 1))
        dashed = f'x1="0" x2="{width}" y1="{row}" y2="{row}" stroke-dasharray="6 4"'
        self._image.show(draw(array, unit), f'<line {dashed} stroke="white"/>', height_vh=42)
        self._follow.html(self._section, _section_svg(array[row], unit, row))

    def _offer_outputs(self, result: Result) -> None:
        names = [name for name in result if _plane(result, name) is not None]
        if names and self._outputs.options != names:
            chosen = self._output if self._output in names else names[0]
            self._outputs.set_options(names, value=chosen)
            self._output = self._tuning.output = self._outputs.value

    def _pressed(self, mouse: Pointed) -> None:
        assert self._image.picture is not None
        height, _ = self._image.picture.array.shape
        self._row = min(max(mouse.y / max(height - 1, 1), 0.0), 1.0)
        self.draw()

    def _output_chosen(self, event: events.ValueChangeEventArguments[Any]) -> None:
        self._output = self._tuning.output = event.value
        self.draw()


def _plane(result: Result, name: str) -> NDArray[Any] | None:
    """An output as one plane, if it is one."""
    if name not in result.outputs:
        return None
    dims = result.plan.port(name).dims
    planes = planes_of(dims, result.outputs[name]) if len(dims) == 2 else []
    return planes[0] if planes else None


def _section_svg(line: NDArray[Any], unit: str, row: int) -> str:
    """One row of the output as a curve."""
    heights = line[np.isfinite(line)]
    low, high = (float(heights.min()), float(heights.max())) if heights.size else (0.0, 1.0)
    span = (high - low) or 1.0
    step = max(1, line.size // 600)
    xs = np.arange(0, line.size, step) * (1000 / max(line.size - 1, 1))
    ys = 112 - 104 * (np.nan_to_num(line[::step].astype(float), nan=low) - low) / span
    points = " ".join(f"{x:.0f},{y:.1f}" for x, y in zip(xs, ys, strict=True))
    return (
        f'<div class="t-help">section along y = {row}, {low:.4g} to {high:.4g} {escape(unit)}; '
        "press in the picture and drag to move it</div>"
        '<svg viewBox="0 0 1000 120" preserveAspectRatio="none">'
        f'<rect width="1000" height="120" fill="#f7f8fa"/><polyline points="{points}" fill="none" '
        f'stroke="{LINE_COLOUR}" stroke-width="1.6" vector-effect="non-scaling-stroke"/></svg>'
    )
