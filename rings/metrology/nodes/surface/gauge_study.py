"""Repeatability and reproducibility of a measured step: a gauge R&R study."""

from collections import Counter
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tactograph.rings.metrology.nodes.surface.measure_step import Across, EdgeCount, measure_step
from tactograph.sdk import Crop, InputError, node
from tactograph.sdk.nodes import read_height, read_pixel_size

HEIGHT_FILE = "height.npy"
CATEGORY_FACTOR = 1.41
"""Distinct categories are this times the parts' deviation over the gauge's (AIAG)."""


@node
def gauge_study(
    *,
    folder: Path,
    figure: Literal["step_depth_um", "step_width_mm", "wall_1_deg", "wall_2_deg"] = "step_depth_um",
    pixel_size_mm: float | None = None,
    crop: Crop | None = None,
    along: Across = "x",
    edges: EdgeCount = 2,
) -> dict[str, float]:
    """Measure the step of every result, and split the variance by parts, operators and trials.

    Analysis of variance of a crossed, balanced study (AIAG, "Measurement systems analysis", 2010):
    repeatability is the deviation of trials, reproducibility that of operators and of how they
    differ from part to part; the gauge's R&R is both.

    Parameters
    ----------
    folder
        Holds ``PART/TRIAL/height.npy``, or ``PART/OPERATOR/TRIAL/height.npy``, results as
        `write_result` leaves them.
    figure : of `measure_step`, what is studied
    pixel_size_mm, crop, along, edges : as for `read_pixel_size`, `read_height` and `measure_step`

    Returns
    -------
    dict
        ``gauge_repeatability``, ``gauge_reproducibility`` (of two operators or more), ``gauge_rr``,
        ``gauge_parts`` and ``gauge_total``, standard deviations in the figure's unit; of two
        parts or more ``gauge_rr_percent`` of the total, and ``gauge_categories``; ``gauge_mean``.

    Raises
    ------
    InputError
        If there are no results, or parts or operators have different numbers of them.
    """

    def measured(file: Path) -> float:
        pixel = read_pixel_size(height=file, mm=pixel_size_mm)
        height = read_height(file=file, crop=crop, unknown=True)
        try:
            return float(measure_step(height, pixel, 0 * height, along=along, edges=edges)[figure])
        except InputError as error:
            raise InputError(f"{file}: {error}") from None
        except KeyError:
            raise InputError(f"{figure}: is measured with `edges`=2 only") from None

    files, shape = _files(folder)
    values = np.array([measured(file) for file in files]).reshape(shape)
    trial, operator, part = _variances(values)
    gauge = trial + operator
    figures = {
        "gauge_mean": float(values.mean()),
        "gauge_repeatability": float(np.sqrt(trial)),
        "gauge_rr": float(np.sqrt(gauge)),
    }
    if values.shape[1] > 1:
        figures["gauge_reproducibility"] = float(np.sqrt(operator))
    if len(values) > 1:
        figures["gauge_parts"] = float(np.sqrt(part))
        figures["gauge_total"] = float(np.sqrt(gauge + part))
        figures["gauge_rr_percent"] = float(100 * np.sqrt(gauge / max(gauge + part, 1e-30)))
        figures["gauge_categories"] = CATEGORY_FACTOR * np.sqrt(part / max(gauge, 1e-30)) // 1
    return figures


def _files(folder: Path) -> tuple[list[Path], tuple[int, int, int]]:
    """The heights by part, operator and trial, and how many there are of each."""
    files = sorted(folder.rglob(HEIGHT_FILE))
    places = [file.relative_to(folder).parts for file in files]
    if {len(place) for place in places} not in ({3}, {4}):
        raise InputError(
            f"{folder}: holds no PART/TRIAL/{HEIGHT_FILE}, nor PART/OPERATOR/TRIAL/{HEIGHT_FILE}"
        )
    trials = Counter(place[:-2] for place in places)
    parts, operators = {place[0] for place in places}, {place[1:-2] for place in places}
    shape = len(parts), len(operators), min(trials.values())
    if np.prod(shape) < len(files) or len(trials) < shape[0] * shape[1] or shape[2] < 2:
        raise InputError(
            f"{folder}: a study has the same number of trials, two or more, of every part by every "
            f"operator; here are {sorted({*trials.values()})} trials of {len(parts)} parts by "
            f"{len(operators)} operators"
        )
    return files, shape


def _variances(values: NDArray[np.float64]) -> tuple[float, float, float]:
    """Variances by trials, by operators with how they differ by part, and by parts."""
    parts, operators, trials = values.shape
    mean, cell = values.mean(), values.mean(axis=2)
    by_part, by_operator = cell.mean(axis=1), cell.mean(axis=0)
    trial = np.square(values - cell[..., None]).sum() / (parts * operators * (trials - 1))
    interaction, free = cell - by_part[:, None] - by_operator + mean, (parts - 1) * (operators - 1)
    within = trials * np.square(interaction).sum() / free if free else trial
    mixed = max((within - trial) / trials, 0.0)
    of_operator = np.square(by_operator - mean).sum() / max(operators - 1, 1)
    operator = max(of_operator - within / (parts * trials), 0.0)
    of_part = np.square(by_part - mean).sum() / max(parts - 1, 1)
    part = max(of_part - within / (operators * trials), 0.0)
    return float(trial), float(operator + mixed), float(part)
