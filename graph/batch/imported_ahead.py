"""Modules of a batch's processes that take long to import and start no lasting thread."""

# ruff: noqa: E402  (collected seldom while they are imported)
from tactograph.graph.run.collect_seldom import collect_seldom

collect_seldom()

import cv2  # noqa: F401

import tactograph.graph.backends.launch
import tactograph.graph.batch.worker  # noqa: F401
