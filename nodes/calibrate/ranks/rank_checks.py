"""Apply the checks of a touch to valid touches of a sensor: its presses, and drawn touches."""

import tempfile
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.graph import load, node
from tactograph.nodes import F8, Light
from tactograph.nodes.calibrate.file.calibration import CALIBRATION_KIND
from tactograph.nodes.files.calibration_file import FileKind
from tactograph.nodes.optics.cell_side import USUAL_SIDE
from tactograph.nodes.optics.sheet import SheetLight, SheetMask, cut
from tactograph.nodes.stored import with_plain
from tactograph.nodes.trust.check_ranks import (
    CHECK_FIGURES,
    REST_FIGURES,
    Ranked,
    figures_of,
    ranked,
)
from tactograph.nodes.trust.checked_cells import MAX_CELLS, MIN_LEDS, few_cells
from tactograph.nodes.trust.judge_touch import MAX_RIM_SHARE
from tactograph.nodes.trust.light_departure import MIN_ERROR
from tactograph.nodes.trust.likely_cause import matt_residual
from tactograph.nodes.trust.line_changes import LineChanges
from tactograph.nodes.trust.touch_evidence import TouchEvidence

LINE_PORTS = ("across_row", "along_row", "across_column")
EVIDENCE_PORTS = {"level": "evidence.level", "figures": "evidence.figures", "motion": "moved"}
RIM_PORTS = {"rims": "on_rims.share"}
LED_PORTS = {"light": "drifted_c", "cells": "flat_c", "leds": "cal.lights", "shifts": "shifts"}
ONE_SHOT_PORTS = {port: f"lines.{port}" for port in LINE_PORTS}


@node
def rank_checks(
    flat: Light | None = None,
    press: SheetLight | None = None,
    mask: SheetMask | None = None,
    *,
    file: Path,
    count: Annotated[int, Interval(ge=10, le=100000)] = 128,
    seed: Annotated[int, Interval(ge=0)] = 0,
) -> None:
    """Draw valid touches of a calibrated sensor, check them, and write the ranks into its file.

    The touches are rendered by the calibration's model within its uncertainty (`draw_touches`), and
    reconstructed by the graphs.  Touches whose height is wrong are left out.  The presses of the
    calibration are valid touches as well, and show errors that the model lacks (`ranked`).

    Parameters
    ----------
    flat : K x H x W, of the presses' size; None: there are no presses
    press : K x S x W, a sheet of presses without lens distortion
    mask : S x W, the pixels that the calibration used; a press without any is left out
    file : the calibration, which is rewritten
    count, seed : number of drawn touches; the same seed gives the same touches
    """
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the calibration has reported its doubts
        brought: Any = FileKind.module_of(file)
        has_film = brought is not None and "flat" in brought.KIND.values
        kind = brought.KIND if has_film else CALIBRATION_KIND
        arrays = kind.stored(file)
        small, even = Path(folder) / "small.npz", Path(folder) / "own.npz"
        # Large images are drawn with fewer, larger pixels, since checks use few cells.
        few = few_cells(arrays["flat"], MAX_CELLS * USUAL_SIDE**2).shape[1:]
        np.savez(small, **_resized(arrays, few, kind.record))  # type: ignore[arg-type]
        params = {"calibration": str(small), "count": count, "seed": seed}
        presses = [] if flat is None or press is None else _presses_of(press, mask, flat.shape[1])
        if presses:
            size = presses[0].shape[1:]
            np.savez(even, **_resized(arrays, size, kind.record))  # type: ignore[arg-type]
        if kind is not CALIBRATION_KIND:
            drawn = _drawn(brought.GRAPH, brought.OVERLAY, params)
            pressed = _press_figures(brought.GRAPH, presses, even, ONE_SHOT_PORTS)[0]
            ranks = [ranked(drawn, pressed)] * len(Ranked)
        else:
            # Three lights are linearly independent, so the paper's shadow test needs four.
            tables = "paper" if len(arrays["flat"]) > MIN_LEDS else "paper_no_shadow"
            ranks = _ranks_of_leds(tables, params, presses, even)
    kind.replace(file, {"ranks": np.stack(ranks)})


def _resized(
    arrays: dict[str, NDArray[Any]], size: tuple[int, ...], record: type
) -> dict[str, NDArray[Any]]:
    """The calibration for images of these rows and columns, without lens, blur and ranks."""
    rows, columns = size
    flat = [cv2.resize(p, (columns, rows), interpolation=cv2.INTER_AREA) for p in arrays["flat"]]
    finer = arrays["flat"].shape[2] / columns
    resized = {"flat": np.stack(flat), "pixel_size": arrays["pixel_size"] * finer}
    for plane in {"dark", "rest"} & arrays.keys():
        resized[plane] = cv2.resize(arrays[plane], (columns, rows), interpolation=cv2.INTER_AREA)
    resized["area"] = np.ones(size, np.uint8)
    # Drawn touches are not blurred.
    resized |= {name: np.zeros_like(arrays[name]) for name in {"blur"} & arrays.keys()}
    others = {name: array for name, array in arrays.items() if name not in ("lens", "ranks")}
    return with_plain(record, others | resized)


def _presses_of(press: SheetLight, mask: SheetMask | None, rows: int) -> list[Light]:
    """The presses that the calibration used."""
    presses = cut(press, rows)
    if mask is None:
        return presses
    return [p for p, used in zip(presses, cut(mask, rows), strict=True) if used.any()]


def _ranks_of_leds(
    tables: str, params: dict[str, Any], presses: list[Light], even: Path
) -> list[F8]:
    """The ranks of each `Ranked`, of a sensor with one image per LED."""
    walls = params | {"count": max(params["count"] // 2, 1), "rigid": True}
    soft, rigid = (
        _drawn("reconstruct", "drawn_touches", each, LED_PORTS) for each in (params, walls)
    )
    plain = _drawn(tables, "drawn_touches", params)
    pressed, rims = _press_figures("reconstruct", presses, even, RIM_PORTS | LED_PORTS)
    of_tables = _press_figures(tables, presses, even)[0]
    on_rims = rims > MAX_RIM_SHARE
    return [
        ranked(soft, _without_walls(pressed, on_rims, soft), rigid),
        ranked(rigid, pressed[on_rims], soft),
        ranked(plain, _without_walls(of_tables, on_rims, plain)),
    ]


def _without_walls(pressed: F8, on_rims: NDArray[np.bool_], drawn: F8) -> F8:
    """The figures of presses as of soft touches.

    Of a press with walls only the film at rest counts.  The other figures are those of presses
    without walls, or, if there are none, usual ones.
    """
    usual = np.median(drawn, axis=0) if on_rims.all() else pressed[~on_rims]
    walls = on_rims[:, None] & ~REST_FIGURES
    return np.where(walls, np.resize(usual, pressed.shape), pressed)


def _press_figures(
    graph: str, presses: list[Light], calibration: Path, more: dict[str, str] | None = None
) -> tuple[F8, F8]:
    """The figures of the calibration's presses, P x 17, and each one's share on rims."""
    figures, rims = [], []
    if presses:
        params = {"calibration": str(calibration), "accept_contradictions": True}
        declared = {"format": 1, "extends": graph, "outputs": EVIDENCE_PORTS | (more or {})}
        with load(declared, params) as pipeline:
            for press in presses:
                # Film that was continued beyond the visible area may exceed the camera's range.
                outputs = pipeline(frames=np.clip(press, 0, 1)).outputs
                figures.append(_figures(outputs))
                rims.append(float(outputs.get("rims", 0.0)))
    return np.array(figures).reshape(len(figures), len(CHECK_FIGURES)), np.array(rims)


def _drawn(
    graph: str, overlay: str, params: dict[str, Any], more: dict[str, str] | None = None
) -> F8:
    """The figures of drawn touches whose height the graph finds, N x 17.

    A height is found if its error over the image's width is at most that of slopes with the error
    `MIN_ERROR`.  At least half of the touches count as found, since a graph may be no better.
    Touches with walls all count, since another graph measures those.
    """
    figures, off = [], []
    declared = {"format": 1, "extends": [graph, overlay], "outputs": more or {}}
    with load(declared, params) as pipeline:
        for result in pipeline.items():
            outputs = result.outputs
            figures.append(_figures(outputs))
            wrong = np.square(outputs["height"] - outputs["truth"], dtype=np.float64).mean()
            off.append(np.sqrt(wrong) / (float(outputs["pixel"]) * outputs["height"].shape[1]))
    most = np.inf if params.get("rigid") else max(MIN_ERROR, np.median(off))
    return np.array(figures)[np.array(off) <= most]


def _figures(outputs: Mapping[str, Any]) -> F8:
    """The figures of one touch."""
    evidence = TouchEvidence(outputs["level"], outputs["figures"])
    lines = LineChanges(*(outputs[n] for n in LINE_PORTS)) if LINE_PORTS[0] in outputs else None
    residual = 0.0
    if "leds" in outputs:
        residual = matt_residual(outputs["light"], outputs["cells"], outputs["leds"])
        residual = np.nan_to_num(residual, posinf=0.0)  # infinite without a touch
    return figures_of(evidence, lines, outputs["motion"], outputs.get("shifts"), residual)
