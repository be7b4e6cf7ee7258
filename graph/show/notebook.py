"""Draw results in a notebook."""

from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np

from tactograph.graph.declare.ports import PortType
from tactograph.graph.show.views import kind_of

MAX_MAPS = 4
"""Largest number of maps of a result to draw."""


def result_html(
    title: str, outputs: Mapping[str, Any], ports: Mapping[str, PortType], milliseconds: float
) -> str:
    """Maps as pictures with their units, labels in colours, figures in a table."""
    from tactograph.graph.show.pictures import draw_labels, draw_maps

    pictures: list[str] = []
    rows: list[tuple[str, str]] = []
    for name, value in outputs.items():
        port = ports[name]
        if isinstance(value, np.ndarray):
            kind = kind_of(port) if value.ndim == len(port.dims) else None  # else of a batch
            is_drawn = kind in ("map", "labels") and bool(value.size) and np.isfinite(value).any()
            if is_drawn and len(pictures) < MAX_MAPS:
                draw = draw_labels if kind == "labels" else draw_maps
                uri = draw({name: value}, f"{name} / {port.unit}")
                pictures.append(f'<img alt="{escape(name)}" style="max-width:26em" src="{uri}">')
            else:
                rows.append(
                    (name, f"{value.dtype} {' x '.join(map(str, value.shape))} {port.unit}")
                )
        elif isinstance(value, dict):
            rows += [(figure, f"{number:.4g}") for figure, number in value.items()]
        elif value is not None:
            rows.append((name, str(value)))
    table = "".join(f"<tr><td>{escape(a)}</td><td>{escape(b)}</td></tr>" for a, b in rows)
    head = f"<p>{escape(title)}: {milliseconds:.1f} ms</p>"
    return f"<div>{head}{''.join(pictures)}<table>{table}</table></div>"
