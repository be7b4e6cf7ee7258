"""What a batch's processes need and takes long to import, but starts no thread."""

from tactograph.graph.run.collect_seldom import collect_seldom

collect_seldom()

import cv2  # noqa: E402, F401

import tactograph.graph.backends.launch  # noqa: E402
import tactograph.graph.batch.worker  # noqa: E402, F401
