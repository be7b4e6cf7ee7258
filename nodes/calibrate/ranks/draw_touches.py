"""Draw random valid touches of a calibrated sensor, within the calibration's uncertainty.

For each touch everything that a calibration leaves uncertain is drawn: the object, the LEDs' places
and the light from film to film within their errors, the errors of the film's model as on held-out
presses, and the LEDs' drift.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from tactograph.graph import node
from tactograph.nodes import Film, Height, Light, Slope
from tactograph.nodes.calibrate.ranks.drawn import Doubts
from tactograph.nodes.files.calibration_file import FileKind
from tactograph.nodes.light.film_bounce import MAX_ALBEDO


class DrawnTouch(NamedTuple):
    """A touch as the camera sees it, the film at rest, and the film as it might be.

    Of a sensor without a model of its film, the film says nothing.
    """

    height: Height
    slope: Slope
    flat: Light
    film: Film


@node
def draw_touches(
    *,
    calibration: Path,
    count: Annotated[int, Interval(ge=1, le=100000)] = 128,
    seed: Annotated[int, Interval(ge=0)] = 0,
    rigid: bool = False,
) -> Iterator[DrawnTouch]:
    """Yield valid touches: balls, edges, folds, grooves, dents and none, shallow and steep.

    Parameters
    ----------
    calibration : the ``.npz`` of the sensor, of any kind with a film at rest and a misfit
    count : number of touches
    seed : the same seed gives the same touches
    rigid : whether no film covers the objects, so that they have walls
    """
    sensor, rng = FileKind.read_sensor(calibration), np.random.default_rng(seed)
    level, width, light, bounce, _tilt = sensor.misfit.tolist()
    film: Film | None = getattr(sensor, "film", None)
    doubts, possible = Doubts(light), Film.matt(np.ones((len(sensor.flat), 3), np.float32))
    if film is not None:
        doubts = Doubts(light, level, width, film.uneven, film.contact)
    for number in range(count):
        if film is not None:
            # The mean square of the alternatives' deviations is the variance (`LedPlaces.sampled`).
            chance = rng.normal(size=len(film.other_lights)) / np.sqrt(len(film.other_lights))
            moved = film.lights + np.tensordot(chance, film.other_lights - film.lights, axes=1)
            albedo = float(np.clip(film.albedo * (1 + bounce * rng.normal()), 0, MAX_ALBEDO))
            possible = film._replace(lights=np.asarray(moved, np.float32), albedo=albedo)
        touch = doubts.touch(rng, number, sensor.flat, float(sensor.pixel_size), rigid)
        yield DrawnTouch(*touch, possible)
