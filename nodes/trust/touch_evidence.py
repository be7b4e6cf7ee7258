"""What the verdict on a touch rests on: its curl, light and film at rest, in a few figures.

Long because the curl, the light and the film at rest are looked at in one node, so that a device is
waited for once.
"""

from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval

from tactograph.graph import Close, Port, SizeLimit, node
from tactograph.graph.backends.launch import DeviceArray, Launch
from tactograph.nodes import F4, CoarseLight, Height, Labels, Light, Slope
from tactograph.nodes.light.film_drift import DRIFT_TERMS, Drift
from tactograph.nodes.trust._curl_evidence import curl_evidence
from tactograph.nodes.trust._light_evidence import LightFigures, light_evidence
from tactograph.nodes.trust._rest_evidence import FilmFigures, RestLevel, rest_evidence
from tactograph.nodes.trust.checked_cells import thinning
from tactograph.nodes.trust.light_departure import Brighter, Departure
from tactograph.nodes.trust.slope_curl import CoarseCurl


class TouchEvidence(NamedTuple):
    """What `judge_touch` judges: little, in arrays as few as can be read back from a device."""

    level: RestLevel
    figures: Annotated[F4, Port("11", "1", low=0, high=5)]
    """Those of the curl, of the film and of the light, one behind the other."""

    def read(self) -> tuple[float, FilmFigures, LightFigures]:
        """How much the slopes curl, what the film at rest is like, and how the light departs."""
        figures = self.figures.tolist()
        return figures[0], FilmFigures(*figures[1:6]), LightFigures(*figures[6:])


@node(
    sizes={"K": SizeLimit(1, 8, "labels have 8 bits")},
    tolerance=Close(1e-5, 1e-3, why="the last bits of a quantile are left open"),
)
def touch_evidence(
    curl: CoarseCurl,
    light: CoarseLight,
    height: Height,
    drift: Drift | None = None,
    departure: Departure | None = None,
    brighter: Brighter | None = None,
    slope: Slope | None = None,
    used: Labels | None = None,
    matt: Light | None = None,
    shadow: Labels | None = None,
    *,
    max_dimming: Annotated[float, Interval(gt=0, le=1)] = 0.3,
) -> TouchEvidence:
    """Return the figures of a touch that speak for it or against it (T1 to T5).

    Parameters
    ----------
    curl : h x w, as `slope_curl` gives it
    light : K x h x w on cells, relative to the flat frame, before any drift is taken out
    height : H x W in mm
    drift : K x 6, as `film_drift` found it
    departure, brighter
        H x W, as `light_departure` gives them.  Without a departure and a slope the light is not
        looked at.
    slope, used, shadow
        2 x H x W and H x W: the slopes, the LEDs that they rest on, and those that do not light a
        pixel.
    matt : K x H x W, the light as of a matt film
    max_dimming : share of the light that film may lack under all LEDs
    """
    figures = LightFigures(0, 0, 0, 0, dirty=-1)
    if departure is not None and slope is not None:
        figures = light_evidence(departure, slope, brighter, used, matt, shadow, max_dimming)
    level, film = rest_evidence(light, height, drift)
    return TouchEvidence(level, np.array([curl_evidence(curl), *film, *figures], np.float32))


@touch_evidence.opencl()
def _launch(run: Launch) -> None:
    """One work-group looks at the light and one at the film; others find quantiles and bands."""
    count, height, width = (run.sizes[name] for name in "KHW")
    step, group, options = thinning(height, width), (run.group,), run.inputs
    thin = (-(-height // step), -(-width // step))
    (curl, light), cells = _thinned(run, options["curl"], options["light"])
    values, gains = run.scratch((4, *thin)), run.scratch((count, DRIFT_TERMS))
    names = ("departure", "brighter", "slope", "used", "matt", "shadow")
    level, figures = run.outputs.values()
    planes = *(options.get(name) for name in names), light, options["height"], options.get("drift")
    scratch = values, run.scratch(cells), gains
    sizes = count, height, width, *thin, step, *cells
    arguments = *planes, *scratch, level, figures, *sizes, run.settings["max_dimming"]
    run.kernel("look", (2 * run.group,), *arguments, local=group)
    weighed = values, curl, figures, thin[0] * thin[1], *cells
    run.kernel("weigh", (5 * run.group,), *weighed, local=group)


def _thinned(run: Launch, *planes: DeviceArray) -> tuple[list[DeviceArray], tuple[int, int]]:
    """Every n-th row and column, and the size of that."""
    rows, columns = (run.sizes[name] for name in "hw")
    step = thinning(rows, columns)
    size = (-(-rows // step), -(-columns // step))
    thinned = []
    for plane in planes:
        count = plane.shape[0] if len(plane.shape) > 2 else 1
        thin = plane if step == 1 else run.scratch((count, *size))
        if step > 1:
            run.kernel("thin", (count, *size), plane, thin, count, *size, rows, columns, step)
        thinned.append(thin)
    return thinned, size


@touch_evidence.example
def _example(
    rng: np.random.Generator, K: int, H: int, W: int, h: int, w: int, **_: int
) -> dict[str, Any]:
    """Film that is steep in bands, narrow or wide, or ripples; LEDs do not reach some of it.

    The LEDs have drifted, a quarter of the film is touched and some of it black; slopes curl by
    chance, more so in a part of the image, in some rows not at all.
    """
    curl = rng.chisquare(1, (h, w)) * np.where(np.arange(w) < w / 2, 1, 6)
    curl *= rng.choice([0, 1, 1], (h, 1))
    drift = np.zeros((K, DRIFT_TERMS))
    drift[:, 0] = rng.uniform(0.95, 1.05, K) if rng.random() < 0.5 else 1
    drift[:, 1:] = rng.uniform(-0.01, 0.01, (K, DRIFT_TERMS - 1))
    light = 1 + rng.normal(0, 0.015, (K, h, w))
    light[:, : h // 2, : w // 2] *= rng.uniform(0.3, 1.5, (K, h // 2, w // 2))
    light[:, :, w - w // 8 :] = 0.01
    width, folded = rng.choice([3, 3, 9]), rng.random() < 0.5
    along = np.arange(W) if rng.random() < 0.5 else np.arange(H)[:, None]
    band = along % (3 * width) < width
    ripple = 0.3 + rng.choice([0.075, 0.2]) * (-1.0) ** (along // 2)
    shape = 0.4 * band * (1 + folded) if rng.random() < 0.7 else ripple
    slope = rng.uniform(-0.02, 0.02, (2, H, W)) + shape
    every, shade = (1 << K) - 1, rng.random((H, W)) < rng.choice([0.05, 0.05, 0.5]) * band
    planes = {
        "curl": np.where(rng.random((h, w)) < rng.choice([0.7, 0.2]), curl, -1),
        "light": light,
        "drift": drift,
        "departure": np.where(
            rng.random((H, W)) < 0.9, rng.chisquare(2, (H, W)), rng.choice([-1, -0.5], (H, W))
        ),
        "slope": slope,
        "brighter": rng.normal(0.01, 0.1, (H, W)),
        "matt": rng.normal(1, 0.08, (K, H, W)) + 0.3 * band,
    }
    labels = {"used": np.where(shade, every & 3, every), "shadow": np.where(shade, 3, 0)}
    arrays = {name: np.asarray(plane, np.float32) for name, plane in planes.items()}
    return arrays | {name: np.asarray(bits, np.uint8) for name, bits in labels.items()}
