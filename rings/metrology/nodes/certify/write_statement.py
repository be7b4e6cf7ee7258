"""Write what a sensor measures, and how surely: one page and one JSON file."""

import json
from pathlib import Path
from typing import NamedTuple

from tactograph.rings.metrology.nodes.certify._statement_page import page
from tactograph.rings.metrology.nodes.certify.response_curve import Response
from tactograph.rings.metrology.nodes.certify.transfer_function import Transfer
from tactograph.rings.metrology.nodes.certify.uncertainty_budget import COVERED_SHARE, Budget
from tactograph.sdk import Provenance, atomic_files, node

JSON_FILE, PAGE_FILE = "statement.json", "statement.html"
AS_MEASURED = "measured"
AS_RENDERED = "film rendered by the calibration's own model"


class Characteristic(NamedTuple):
    """A figure of a statement: its unit, and what it is."""

    name: str
    unit: str
    meaning: str
    how: str = AS_MEASURED


STATED_FIGURES = (
    Characteristic("measurement_noise_um", "um", "Sq of differences of repeats, over root two"),
    Characteristic("topography_repeatability_um", "um", "standard deviation over still repeats"),
    Characteristic("drift_um", "um", "mean height, from the first repeat to the last"),
    Characteristic("flatness_deviation_um", "um", "Sz of the untouched film"),
    Characteristic("amplification_coefficient", "1", "slope of found over true height"),
    Characteristic("amplification_spread", "1", "its standard deviation from shape to shape"),
    Characteristic("linearity_deviation_um", "um", "largest distance of the response from a line"),
    Characteristic("topography_fidelity_um", "um", "root mean square of found less true height"),
    Characteristic("reproducibility_percent", "%", "of a height, from touch to touch"),
    Characteristic(
        "topographic_spatial_resolution_mm",
        "mm",
        "wave whose height comes through by half (W_R)",
        AS_RENDERED,
    ),
    Characteristic("xy_amplification_coefficient", "1", "found over true lengths in x and y"),
    Characteristic("xy_mapping_deviation_um", "um", "largest departure of a place from its own"),
)


@node
def write_statement(
    noise: dict[str, float],
    flatness: dict[str, float],
    response: Response,
    transfer: Transfer,
    xy: dict[str, float],
    budget: Budget,
    *,
    folder: Path,
    provenance: Provenance,
) -> None:
    """Write ``statement.html`` and ``statement.json``; what was not measured is blank in both.

    Parameters
    ----------
    noise, flatness, response, transfer, xy, budget : of the nodes of those names
    folder : created if needed
    provenance : given by the engine

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    figures = {**noise, **flatness, **response.metrics, **transfer.metrics, **xy}
    entries = [
        {
            **each._asdict(),
            "value": figures.get(each.name),
            "how": each.how * (each.name in figures),
        }
        for each in STATED_FIGURES
    ]
    curves = {"response": response.curve, "transfer": transfer.curve}
    statement = {
        "format": 1,
        "coverage": COVERED_SHARE,
        "characteristics": entries,
        "not_measured": [entry["name"] for entry in entries if entry["value"] is None],
        "budget": [row._asdict() for row in budget.rows],
        "uncertainty": budget.metrics,
        "counts": {name: value for name, value in figures.items() if name.startswith("known_")},
        "curves": {name: None if at is None else at.tolist() for name, at in curves.items()},
        "provenance": provenance.as_dict(),
    }
    with atomic_files(folder, last=JSON_FILE) as target:
        title, about = "What this sensor measures", _about(figures, provenance)
        text = page(title, about, entries, budget.rows, budget.metrics, curves)
        (target / PAGE_FILE).write_text(text, encoding="utf-8")
        (target / JSON_FILE).write_text(
            json.dumps(statement, indent=1, default=str), encoding="utf-8"
        )


def _about(figures: dict[str, float], provenance: Provenance) -> list[str]:
    """What the statement is of, and what it holds for."""
    of = provenance.inputs.get("calibration", {})
    identity = [f"{name} {text}" for name, text in sorted(of.items())]
    lines = [f"Calibration: {', '.join(identity)}." if identity else ""]
    if "known_shapes" in figures:
        shapes, touches = int(figures["known_shapes"]), int(figures["known_touches"])
        reach = figures["height_range_um"]
        lines.append(
            f"Compared with {shapes} known shapes in {touches} touches, over {reach:.0f} um of "
            "height. It holds for shapes, depths and slopes such as these."
        )
    lines.append(
        "Terms are those of ISO 25178-600. Uncertainties follow the GUM: they hold for 95.45 %, "
        "which is k = 2 where shapes are many. The film is part of the object: how it follows what "
        "is pressed on it is not stated here."
    )
    return [line for line in lines if line]
