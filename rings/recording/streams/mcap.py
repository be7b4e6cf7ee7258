"""Heights in MCAP files, as `write_mcap` writes them."""

from pathlib import Path

import numpy as np

from tactograph.rings.recording.files.mcap_read import McapFile
from tactograph.sdk import F4, InputError
from tactograph.sdk.unstable import on_even_grid, view_of_text

HEIGHT_TOPIC, MM_PER_METRE = "/height", np.float32(1000)


def read_heights(files: list[Path]) -> list[F4]:
    """Read the heights of all files in order, each H x W in mm on an even grid.

    Raises
    ------
    InputError
        If a file cannot be read, states no view, or holds frames and no heights.
    """
    heights, topics = [], set[str]()
    for file in map(McapFile, files):
        for message in file.messages():
            if message.topic == HEIGHT_TOPIC:
                image = message.body
                plane = np.frombuffer(image.data, "<f4").reshape(image.height, image.width)
                lens, camera = view_of_text(file.about.get("view", "{}"), file.path)
                even, _ = on_even_grid(MM_PER_METRE * plane, [], lens, camera or 0.0)
                heights.append(even)
        topics |= file.topics
    if any(topic.endswith("image_raw") for topic in topics) and not heights:
        raise InputError(
            f"{files[0].parent}: holds frames, not heights; give the sensor's calibration=... as "
            "well"
        )
    return heights
