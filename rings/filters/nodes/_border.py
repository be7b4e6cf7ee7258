"""Pixels beyond the frame: OpenCV's border rules, by OpenCV's names."""

from typing import Literal

import cv2

Border = Literal["replicate", "reflect", "reflect_101"]
"""For a row a b c d: aaa|abcd|ddd, cba|abcd|dcb, dcb|abcd|cba; `border.clh` has the same order."""

BORDER_TYPES: dict[Border, int] = {
    "replicate": cv2.BORDER_REPLICATE,
    "reflect": cv2.BORDER_REFLECT,
    "reflect_101": cv2.BORDER_REFLECT_101,
}
