"""The statement as a page that holds its own pictures."""

import base64
import io
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tactograph.rings.metrology.nodes.certify.transfer_function import CUT_OFF_SHARE
from tactograph.rings.metrology.nodes.certify.uncertainty_budget import BudgetRow
from tactograph.sdk import F8, Colour

PAGE_TEXT = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
body {{ font: 15px/1.5 sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em; }}
table {{ border-collapse: collapse; margin: 1em 0; }}
td, th {{ border-bottom: 1px solid #ccc; padding: .2em .8em; text-align: left; }}
td.number {{ text-align: right; }} img {{ max-width: 100%; }} .blank {{ color: #999; }}
</style></head><body><h1>{title}</h1>
{body}
</body></html>
"""


def page(
    title: str,
    about: Sequence[str],
    characteristics: Sequence[Mapping[str, Any]],
    rows: Sequence[BudgetRow],
    figures: dict[str, float],
    curves: Mapping[str, F8 | None],
) -> str:
    """Return the page as HTML."""
    body = [f"<p>{escape(line)}</p>" for line in about]
    body += ["<h2>Metrological characteristics</h2>", _characteristics(characteristics)]
    body += ["<h2>Budget of the uncertainty of a height</h2>", _budget(rows, figures)]
    drawn = (_response(curves["response"], figures), _transfer(curves["transfer"]))
    body += [f'<img alt="{alt}" src="{uri}">' for alt, uri in filter(None, drawn)]
    return PAGE_TEXT.format(title=escape(title), body="\n".join(body))


def _characteristics(entries: Sequence[Mapping[str, Any]]) -> str:
    head = "<tr><th>characteristic</th><th></th><th>unit</th><th>by</th><th>what it is</th></tr>"
    lines = []
    for entry in entries:
        has_value = entry["value"] is not None
        value = f"{entry['value']:.4g}" if has_value else "not measured"
        cells = (entry["name"], value, entry["unit"], entry["how"] or "", entry["meaning"])
        name, number, *others = (escape(cell) for cell in cells)
        kind = "number" if has_value else "blank"
        rest = "".join(f"<td>{cell}</td>" for cell in others)
        lines.append(f'<tr><td>{name}</td><td class="{kind}">{number}</td>{rest}</tr>')
    return f"<table>{head}{''.join(lines)}</table>"


def _budget(rows: Sequence[BudgetRow], figures: dict[str, float]) -> str:
    top = figures.get("uncertainty_height_um")
    head = "<tr><th>input</th><th>u</th><th>distribution</th><th>c</th><th>c u / um</th></tr>"
    lines = []
    for row in rows:
        if row.uncertainty is None:
            lines.append(f'<tr class="blank"><td>{row.name}</td><td>not measured</td></tr>')
            continue
        by = f"{top:.0f} um" if row.sensitivity == "height" and top else "1"
        share = row.uncertainty * (top or 0.0) if row.sensitivity == "height" else row.uncertainty
        unit = "" if row.unit == "1" else " um"
        cells = (row.name, f"{row.uncertainty:.3g}{unit}", row.distribution, by, f"{share:.3g}")
        lines.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    text = ""
    if top is not None:
        factor = figures["coverage_factor"]
        agrees = "agrees" if figures["monte_carlo_agrees"] else "does not agree"
        text = (
            f"<p>U = {figures['expanded_uncertainty_um']:.3g} um (95.45 %, k = {factor:.3g}) at a "
            f"height of {top:.3g} um; at any other z, U = {factor:.3g} sqrt("
            f"({figures['uncertainty_constant_um']:.3g} um)^2 + "
            f"({figures['uncertainty_relative']:.3g} z)^2). By drawing (GUM S1) "
            f"{figures['monte_carlo_um']:.3g} um, which {agrees} to two digits of u.</p>"
        )
    if (percent := figures.get("held_out_percent")) is not None:
        text += (
            f"<p>Of points of shapes that were held out {percent:.1f} % (standard uncertainty "
            f"{figures['held_out_error_percent']:.1f} %, as shapes differ) lie within the "
            "intervals of the budget that the others give.</p>"
        )
    return f"<table>{head}{''.join(lines)}</table>{text}"


def _response(curve: F8 | None, figures: dict[str, float]) -> tuple[str, str] | None:
    if curve is None:
        return None
    true, apart, spread = 1e3 * curve
    figure = Figure(figsize=(9, 3.5), dpi=100, layout="constrained")
    axes = figure.subplots()
    z = np.linspace(true.min(), true.max(), 100)
    parts = figures["uncertainty_constant_um"], figures["uncertainty_relative"] * z
    half = figures["coverage_factor"] * np.hypot(*parts)
    axes.fill_between(z, -half, half, color=Colour.GREY, alpha=0.3, linewidth=0, label="U")
    axes.errorbar(
        true, apart, spread, color=Colour.BLUE, marker="o", capsize=3, label="found - true"
    )
    axes.set(xlabel="true height / um", ylabel="deviation / um", title="Response along z")
    axes.legend(loc="upper center")
    return "Response along z", _uri(figure)


def _transfer(curve: F8 | None) -> tuple[str, str] | None:
    if curve is None:
        return None
    figure = Figure(figsize=(9, 3.5), dpi=100, layout="constrained")
    axes = figure.subplots()
    axes.plot(*curve, color=Colour.BLUE)
    axes.axhline(CUT_OFF_SHARE, color=Colour.ORANGE, linestyle="--", linewidth=1)
    title = "Instrument transfer function, film rendered by the calibration"
    axes.set(xlabel="spatial frequency / (1/mm)", ylabel="height response", title=title)
    return title, _uri(figure)


def _uri(figure: Figure) -> str:
    with io.BytesIO() as file:
        FigureCanvasAgg(figure).print_png(file)
        return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()
