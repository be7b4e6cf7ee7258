"""Modules of a batch's processes that take long to import and start no lasting thread."""

# ruff: noqa: F401
import cv2

import tactograph.rings.batch.worker
from tactograph.sdk import Launch, load
