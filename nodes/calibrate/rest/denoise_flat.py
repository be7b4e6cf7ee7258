"""Smooth the flat frame where the presses do not confirm its detail."""

from itertools import pairwise

import cv2
import numpy as np
from numpy.polynomial.chebyshev import chebvander

from tactograph.graph import node
from tactograph.nodes import F4, Light, robust_deviation
from tactograph.nodes.calibrate import MIN_FLAT_LIGHT
from tactograph.nodes.optics.block_sums import block_sums
from tactograph.nodes.optics.sheet import SheetLight, cut

SCALES_PX = (4.0, 8.0, 16.0, 32.0)
"""Standard deviations of the Gaussians that separate the bands of detail."""
MIN_SIDE_DEVIATIONS = 8
"""Smallest side of an image for a Gaussian, in its standard deviations."""
TREND_DEGREE = 6
"""Degree of the polynomial trend of the light over the image, which is always kept."""
BLOCK_PX = 32
"""Side of a block in px; only the calmer half of a press's blocks, the untouched one, counts."""
MARK_DEVIATIONS, CONFIRMED_SHARE = 5.0, 0.5
"""Detail above this many standard deviations is kept if presses show at least this share of it."""


@node
def denoise_flat(flat: Light, image: SheetLight) -> Light:
    """Return the flat frame without the detail that the presses of a calibration do not show.

    The flat frame divides every capture, so its noise enters every result.  A real film also
    settles with a different grain after every touch.  Fixed detail (albedo, dirt, markers, the
    lens) also shows in the untouched parts of the presses.  So the logarithm of the light
    is split into bands of detail, and each band is multiplied by cov(flat, press) / var(flat)
    (Wiener's filter).  Strong detail that the presses show at the same pixel is kept, and so is
    everything coarser than the widest Gaussian.

    Parameters
    ----------
    flat : K x H x W, the film at rest; a uniform one is returned unchanged
    image : K x S x W, the presses as captured, on a sheet (`sheet`)
    """
    denoised = flat.copy()
    for plane, sheet, result in zip(flat, image, denoised, strict=True):
        if np.ptp(plane) > 0:
            log_flat, *presses = (
                np.log(np.maximum(part, MIN_FLAT_LIGHT))
                for part in (plane, *cut(sheet, len(plane)))
            )
            np.copyto(result, np.exp(_confirmed(log_flat, presses)), where=plane > MIN_FLAT_LIGHT)
    return denoised


def _confirmed(flat: F4, presses: list[F4]) -> F4:
    bands, smooth = _bands(flat)
    bands_shown = [_bands(press)[0] for press in presses]
    calm = [_calm(of_press[-1]) for of_press in bands_shown] if bands else []
    for i, band in enumerate(bands):
        others = [of_press[i] for of_press in bands_shown]
        shared = sum(
            (block_sums(band * other, BLOCK_PX) * c).sum()
            for other, c in zip(others, calm, strict=True)
        )
        square = block_sums(band * band, BLOCK_PX)
        whole = sum((square * c).sum() for c in calm)
        share = np.float32(np.clip(shared / whole, 0, 1)) if whole > 0 else np.float32(1)
        mean = np.mean(others, axis=0)
        spread = robust_deviation(band)
        mark = (np.abs(band) > MARK_DEVIATIONS * spread) & (
            band * mean > CONFIRMED_SHARE * band * band
        )
        smooth = np.asarray(smooth + np.where(mark, np.float32(1), share) * band, np.float32)
    return smooth


def _bands(plane: F4) -> tuple[list[F4], F4]:
    """The detail between each scale and the next, and the coarser remainder.

    Remove the trend first, so that the remainder can be mirrored at the borders.
    """
    trend = _trend(plane)
    residual = plane - trend
    scales = [s for s in SCALES_PX if MIN_SIDE_DEVIATIONS * s < min(plane.shape)]
    levels = [residual, *(cv2.GaussianBlur(residual, (0, 0), scale) for scale in scales)]
    return [fine - coarse for fine, coarse in pairwise(levels)], trend + levels[-1]


def _trend(plane: F4) -> F4:
    """The least-squares polynomial, of `TREND_DEGREE` along x and along y."""
    down, across = (
        np.linalg.qr(chebvander(np.linspace(-1, 1, side), TREND_DEGREE))[0].astype(np.float32)
        for side in plane.shape
    )
    return np.asarray(down @ (down.T @ plane @ across) @ across.T, np.float32)


def _calm(band: F4) -> F4:
    """1 for the half of the blocks that vary least, 0 for the other half."""
    rough = block_sums(band * band, BLOCK_PX)
    return np.asarray(rough <= np.median(rough), np.float32)
