"""The instrument transfer function, and the wave that comes through by half."""

from typing import Annotated, NamedTuple

import numpy as np

from tactograph.rings.metrology.nodes.certify.measure_touches import Heights
from tactograph.sdk import F8, PixelSize, Port, node, warn

CUT_OFF_SHARE = 0.5
"""Height response at which a wave counts as resolved (ISO 25178-600, lateral period limit)."""
NYQUIST_FREQUENCY = 0.5
"""Cycles per pixel above which a map shows no wave."""


class Transfer(NamedTuple):
    """Figures, and the curve: cycles per mm, and the height response there."""

    metrics: dict[str, float]
    curve: Annotated[F8, Port("2 S", "1")] | None = None


@node
def transfer_function(
    height: Heights | None = None, truth: Heights | None = None, pixel: PixelSize | None = None
) -> Transfer:
    """Return the height response by spatial frequency, over all directions.

    Of true spectra T and found spectra F the response is sum(conj(T) F) / sum(|T|^2) over the
    touches and a ring of frequencies, which noise of F leaves unbiased (the estimator H1 of
    Bendat and Piersol).  A Hann window keeps the frame's border out.  It holds for small slopes,
    where a sensor is linear.

    Parameters
    ----------
    height, truth : N x H x W in mm, found and true; None: not measured
    pixel : mm per px

    Returns
    -------
    Transfer
        ``topographic_spatial_resolution_mm``, the longest wave whose response is one half, the
        W_R of ISO 25178-600.
    """
    if height is None or truth is None or pixel is None:
        return Transfer({})
    rows, columns = truth.shape[1:]
    window = np.outer(np.hanning(rows), np.hanning(columns))
    measured, true = (_spectrum(each, window) for each in (height, truth))
    u, v = np.fft.rfftfreq(columns), np.fft.fftfreq(rows)[:, None]
    side = min(rows, columns)
    ring = np.rint(np.hypot(u, v) * side).astype(int)
    inside = (ring > 1) & (ring <= NYQUIST_FREQUENCY * side)
    power = np.bincount(ring[inside], np.square(np.abs(true)).sum(0)[inside])
    shared = np.bincount(ring[inside], (true.conj() * measured).real.sum(0)[inside])
    numbers = np.flatnonzero(power > 0)
    response, cycles = shared[numbers] / power[numbers], numbers / side
    lower = np.flatnonzero(response < CUT_OFF_SHARE)
    if len(lower):
        after = max(int(lower[0]), 1)
        share = (response[after - 1] - CUT_OFF_SHARE) / (response[after - 1] - response[after])
        cut = cycles[after - 1] + share * (cycles[after] - cycles[after - 1])
    else:
        cut = NYQUIST_FREQUENCY
        warn("all waves that pixels show come through by more than half: pixels limit resolution")
    figures = {"topographic_spatial_resolution_mm": float(pixel / cut)}
    return Transfer(figures, np.stack([cycles / pixel, response]))


def _spectrum(heights: Heights, window: F8) -> np.ndarray:
    maps = heights.astype(np.float64)
    means = (maps * window).sum(axis=(1, 2), keepdims=True) / window.sum()
    return np.asarray(np.fft.rfft2((maps - means) * window))
