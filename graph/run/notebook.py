"""How pipelines and results draw themselves in a notebook."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np

from tactograph.graph.plan.plan import Plan

SHOWN = 4
"""Maps that a result draws."""


def result_html(plan: Plan, outputs: Mapping[str, Any], total: float) -> str:
    """Maps as pictures with their units, labels in colours, figures in a table."""
    from tactograph.graph.compare.drawable_arrays import View, kind_of
    from tactograph.graph.compare.pictures import draw_labels, draw_maps

    parts: list[str] = []
    rows: list[tuple[str, str]] = []
    for name, value in outputs.items():
        made_by = plan.outputs[name]
        port = plan.tasks[made_by.node].node.outputs[made_by.port]
        kind = kind_of(port) if isinstance(value, np.ndarray) and value.size else None
        if kind in ("map", "labels") and len(parts) < SHOWN and np.isfinite(value).any():
            view = View(name, kind, port.unit, value)
            draw = draw_labels if kind == "labels" else draw_maps
            picture = draw({name: view.array}, f"{name} / {view.unit}")
            parts.append(f'<img alt="{escape(name)}" style="max-width:26em" src="{picture}">')
        elif isinstance(value, np.ndarray):
            rows.append((name, f"{value.dtype} {' x '.join(map(str, value.shape))} {port.unit}"))
        elif isinstance(value, dict):
            rows += [(figure, f"{number:.4g}") for figure, number in value.items()]
        elif value is not None:
            rows.append((name, str(value)))
    table = "".join(f"<tr><td>{escape(a)}</td><td>{escape(b)}</td></tr>" for a, b in rows)
    head = f"<p>{escape(plan.graph.title or plan.graph.name)}: {total:.1f} ms</p>"
    return f"<div>{head}{''.join(parts)}<table>{table}</table></div>"
