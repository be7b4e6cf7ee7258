"""Images of a film's light as a calibrated camera records them."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Ge, Interval

from tactograph.graph import Session, node
from tactograph.nodes import Dark, Lens, Light, Noise
from tactograph.nodes.optics.bicubic import between_pixels
from tactograph.nodes.optics.lens import ideal_places, is_straight


@node
def expose_film(
    light: Light,
    flat: Light,
    noise: Noise,
    dark: Dark | None = None,
    lens: Lens | None = None,
    *,
    bits: Annotated[int, Interval(ge=1, le=16)] = 8,
    seed: Annotated[int, Ge(0)] | None = None,
    session: Session,
) -> Light:
    """Return dark + flat light, seen through the lens, with the camera's noise.

    NumPy only, because the same seed must give the same noise on every machine.  From image to
    image of a session the noise goes on: no two have the same.

    Parameters
    ----------
    light
        K x H x W, relative to the film at rest.
    flat
        K x H x W, the untouched film.
    noise
        (shot, read): the variance of an image I is shot I + read.
    dark
        H x W, what the camera sees with all LEDs off.
    lens
        Length 8; the images are those of the camera's pixels.
    bits
        Bit depth; 0 to 2^bits - 1 become 0 to 1.
    seed
        Of the noise, the same for the same seed; None: no noise.
    session
        Keeps how far the noise of each seed has come.

    Returns
    -------
    ndarray
        K x H x W, fractions of full scale.
    """
    image = light * flat if dark is None else light * flat + dark
    if lens is not None and not is_straight(lens):
        seen = ideal_places(lens, image.shape[1:])
        image = np.stack([between_pixels(plane, *seen) for plane in image])
    if seed is not None:
        shot, read = noise
        deviation = np.sqrt(shot * np.maximum(image, 0) + read)
        begun: dict[int, np.random.Generator] = session.keep(dict)
        rng = begun.setdefault(seed, np.random.Generator(np.random.Philox(seed)))
        image = image + deviation * rng.normal(size=image.shape)
    steps = 2**bits - 1
    return np.asarray(np.rint(np.clip(image, 0, 1) * steps) / steps, np.float32)
