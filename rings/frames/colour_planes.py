"""The lights of a one-shot sensor's colour frame, and lights as whole levels."""

from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.sdk import F4, Light

Order = Literal["bgr", "rgb"]
MAX_BYTE = 255
MAX_LEVEL = 65535


def planes_of(data: NDArray[Any], order: Order, top: float = 1.0) -> Light:
    """Return the lights of a driver's colour frame (H x W x 3) as 3 x H x W, 0 to 1."""
    ordered = cv2.split(data) if order == "bgr" else cv2.split(data)[::-1]
    scale = np.float32(1 / top)
    image: F4 = np.empty((len(ordered), *data.shape[:2]), np.float32)
    for plane, into in zip(ordered, image, strict=True):
        np.multiply(plane, scale, out=into)
    return image


def in_bytes(light: F4) -> NDArray[np.uint8]:
    """Return light, 0 to 1, as the nearest of 256 levels."""
    return np.clip(np.rint(light * np.float32(MAX_BYTE)), 0, MAX_BYTE).astype(np.uint8)


def in_levels(light: F4) -> NDArray[np.uint16]:
    """Return light, 0 to 1, as the nearest of 65,536 levels."""
    return np.rint(light * MAX_LEVEL).astype(np.uint16)


def in_16_bits(values: NDArray[Any], bits: int) -> NDArray[Any]:
    """Return integers of `bits` bits spread over 16, so that full scale is full scale."""
    return (values << (16 - bits)) | (values >> (2 * bits - 16))
