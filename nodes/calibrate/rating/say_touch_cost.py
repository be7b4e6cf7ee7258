"""Say what the parts of a film cost each touch afterwards."""

import sys
import time
import warnings
from pathlib import Path
from statistics import median

from tactograph.graph import node
from tactograph.nodes import Film, Light

MAX_TOUCHES, MAX_TIMED_S = 4, 0.5
"""Touches that are timed, of which the first fills caches; seconds after which no other begins."""
MAX_TOUCH_PIXELS = 10**6
"""Larger images, which take more memory than the calibration, are not tried."""
NODE_OF_PART = {"light from film to film": "film_bounce", "the coat": "matt_light"}
CLEAR_LINE = "\r\x1b[K"
"""What removes the stage that `run` shows on a terminal."""


@node
def say_touch_cost(image: Light, film: Film, *, file: Path, lights: str | None = None) -> None:
    """Run `reconstruct` on a press, and print its time and that of the coat and of bounced light.

    Only for a person at a terminal, for a film that has one of them, and where there is a device
    whose kernels are on disk.  Nothing of it is stored: it differs from run to run.

    Parameters
    ----------
    image : K x H x W, a press as captured
    film : what was found
    file : the calibration, which is written already
    lights : as for `read_calibration`
    """
    has_part = film.albedo > 0, film.refraction > 1
    parts = [part for part, has in zip(NODE_OF_PART, has_part, strict=True) if has]
    height, width = image.shape[1:]
    if not parts or height * width > MAX_TOUCH_PIXELS or not sys.stdout.isatty():
        return
    from tactograph import load  # the engine finds nodes, and so imports this file

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the calibration has told of its doubts
        with load("reconstruct", calibration=file, lights=lights, outputs=["height"]) as pipeline:
            if not pipeline.built:
                return
            end, touches = time.monotonic() + MAX_TIMED_S, [pipeline(frames=image)]
            while len(touches) < MAX_TOUCHES and time.monotonic() < end:
                touches.append(pipeline(frames=image))
    timed, tasks = touches[1:] or touches, pipeline.plan.tasks.values()

    def took(part: str) -> str:
        steps = [task.id for task in tasks if task.node.name == NODE_OF_PART[part]]
        return f"{part} {median(sum(each.times[s] for s in steps) for each in timed):.0f} ms"

    total = median(each.total for each in timed)
    said = f"a touch of {width} x {height} on this film: reconstruct {total:.0f} ms"
    print(f"{CLEAR_LINE}{said}; of it {', '.join(map(took, parts))}", flush=True)
