"""Estimate the ambient light where no image with all LEDs off was taken."""

from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from scipy import optimize
from scipy.ndimage import binary_dilation, uniform_filter

from tactograph.graph import NodeCall, SizeLimit, node
from tactograph.nodes import F4, F8, Dark, Film, Light, Metrics, PixelSize
from tactograph.nodes.calibrate.lights.descend import least_squares
from tactograph.nodes.calibrate.lights.light_fit import LedFit
from tactograph.nodes.calibrate.lights.light_samples import (
    EDGE_MARGIN_PX,
    LIGHT_DEVIATION,
    MAX_SAMPLES_EACH,
    Press,
    Rest,
    presses_of,
    unreached,
)
from tactograph.nodes.calibrate.tables.label_lit import label_lit
from tactograph.nodes.light.film_bounce import MAX_ALBEDO, film_bounce
from tactograph.nodes.light.flat_field import flat_field
from tactograph.nodes.optics.rest_shape import RestShape
from tactograph.nodes.optics.sheet import SheetHeight, SheetLight, SheetMask, SheetSlope

MIN_AMBIENT = 0.01
"""Ambient light, relative to the film at rest, too weak to tell from an imperfect ball."""
AMBIENT_TOLERANCE = 0.002
"""Tolerance of the search, relative to the film at rest."""
DARK_PERCENT = 0.1
"""Per cent of the pixels that may be darker than the ambient light: dead pixels and noise."""
MAX_MISFIT_SHARE = 0.5
"""Largest share of the misfit that may remain if ambient light is the cause."""
MAX_DARK_RATIO = 1.5
"""Light, relative to the darkest pixels, that ambient light cannot reach."""
SMOOTHING_PX = 5
"""Width in px of the mean that suppresses noise in the darkest pixels."""
MAX_PRESSES = 3
"""Most presses that are used: they suffice for one number."""


class WithoutAmbient(NamedTuple):
    """The film at rest without ambient light, the dark image, the figure, and a doubt."""

    flat: Light
    dark: Dark
    quality: Metrics
    doubts: list[str]


@node(sizes={"K": SizeLimit(3, 8, "two LEDs leave two slopes, a label has 8 bits")})
def find_ambient(
    image: SheetLight,
    flat: Light,
    dark: Dark,
    slope: SheetSlope,
    mask: SheetMask,
    height: SheetHeight,
    pixel: PixelSize,
    shape: RestShape | None = None,
    *,
    taken: Path | None = None,
    bounce: NodeCall = film_bounce,
) -> WithoutAmbient:
    """Return flat frame and dark image of a sensor that ambient light reaches.

    Daylight and the camera's black level add the same light to the object and to the film at
    rest.  Divided by the film's light, the object's is ``n.v + (1 - n.v) b``, where b is their
    share of the film's light: as if every LED stood nearer to the camera's axis.  LEDs are
    placed for different b (`calibrate_lights`), and the b with the smallest misfit is taken.
    It cannot exceed the light of the darkest pixels, since ambient light reaches them, too.
    Light from film to film looks alike on the object, but also brightens the film beside it, where
    ambient light changes nothing; what that film tells is taken off first.

    Parameters
    ----------
    image : K x S x W, the presses as captured, on a sheet (`sheet`)
    flat, dark
        K x H x W and H x W, as `read_flat` returns them.  If the flat frame is uniform, because
        none was taken, nothing is estimated.
    slope, mask, height
        2 x S x W, S x W, S x W in mm: of the presses, as `press_slopes` returns them.
    pixel : mm per px
    shape : the film at rest if it is no plane
    taken : the image with all LEDs off, if one was taken; then nothing is estimated

    Returns
    -------
    The flat frame minus the ambient light; the dark image, which is that light everywhere;
    ``ambient_percent`` of full scale.  Ambient light that was found is a doubt: it is a guess, and
    a wrong radius or gamma looks alike.
    """
    nothing = WithoutAmbient(flat, dark, {}, [])
    if taken is not None or Rest.of(flat, pixel) is None:
        return nothing
    presses = presses_of(image, slope, mask, height, label_lit(image), flat.shape[1])
    sensor = _Sensor([p for p in presses if p.mask.any()][:MAX_PRESSES], flat, pixel, shape)
    # The light that all but a few pixels exceed under every LED.
    smooth = [uniform_filter(plane, (SMOOTHING_PX, SMOOTHING_PX)) for plane in image]
    most = min(float(np.percentile(plane, DARK_PERCENT)) for plane in smooth)
    least = MIN_AMBIENT * float(np.median(flat))
    if not sensor.presses or most < least:
        return nothing
    placed, plain = sensor.placed(0.0)
    if plain <= sensor.placed(least)[1]:
        return nothing
    # LEDs that face the film's middle light its sides less, which looks like ambient light.
    points = sensor.unbounced(placed, bounce)
    disks = points._replace(leds=placed._replace(emission=1.0))
    found = (each.likeliest(most) for each in (points, disks))
    residual, ambient, sensor = min(found, key=lambda each: each[0])
    beyond, without = (sensor.placed(a)[1] for a in (MAX_DARK_RATIO * most, 0.0))
    if ambient < least or residual > MAX_MISFIT_SHARE * without or beyond < residual:
        # Light diffused in the gel has a similar effect, which `fit_film` models.
        return nothing
    percent = 100 * ambient
    doubt = (
        f"{percent:.1f} % of full scale seems to be light that no LED gives, and is taken off: "
        "take an image with all LEDs off (`taken`=FILE); if it is black, check the ball's radius, "
        "`pixel` and that the camera is linear (gamma 1)"
    )
    rest_light, dark = _led_light(flat, ambient), np.full_like(dark, ambient)
    return WithoutAmbient(rest_light, dark, {"ambient_percent": percent}, [doubt])


class _Sensor(NamedTuple):
    """Presses and the film at rest as captured, with light of which a part may be ambient."""

    presses: list[Press]
    flat: Light
    pixel: float
    shape: RestShape | None
    leds: Film | None = None
    """What is known about how the LEDs emit; None: alike everywhere."""

    def placed(self, ambient: float) -> tuple[Film, float]:
        """Place LEDs after this much ambient light is subtracted; return them and their misfit."""
        flat, (_, rows, columns) = _led_light(self.flat, ambient), self.flat.shape
        dark, objects = np.full((rows, columns), ambient, np.float32), []
        for press in self.presses:
            light = flat_field(press.light, flat, dark)
            brightened = press._replace(light=light, lit=label_lit(light))
            objects.append(brightened.samples(self.pixel, MAX_SAMPLES_EACH, self.shape))
        if unreached(objects):
            return Film.matt(np.zeros((len(flat), 3), np.float32)), np.inf
        rest = Rest.of(flat, self.pixel, self.shape)
        if self.leds is not None and rest is not None:
            rest = rest.under_points(self.leds)
        fit = LedFit.of(objects, rest, self.pixel * columns)
        return Film.matt(fit.lights), fit.cost(objects, rest)

    def likeliest(self, most: float) -> tuple[float, float, Self]:
        """Return the least misfit, the ambient light that leaves it, and the sensor."""
        minimize: Any = optimize.minimize_scalar  # its stubs know no bounds
        stop = {"xatol": AMBIENT_TOLERANCE * float(np.median(self.flat))}
        found = minimize(
            lambda ambient: self.placed(ambient)[1],
            bounds=(0, most), method="bounded", options=stop,
        )  # fmt: skip
        return float(found.fun), float(found.x), self

    def unbounced(self, film: Film, bounce: NodeCall) -> Self:
        """Return the sensor without light from film to film.

        That brightens film beside a press, too, where ambient light changes nothing: there it is
        told.  Film that hangs or lies in shadow is darker, and tells less.
        """
        film, presses = film._replace(albedo=MAX_ALBEDO), []
        for press in self.presses if self.shape is None else ():
            light = flat_field(press.light, self.flat, np.zeros_like(press.height))
            thrown = bounce(light, press.height, film, self.pixel)
            beside = ~binary_dilation(press.height > 0, iterations=EDGE_MARGIN_PX)
            more, by = (each.mean(axis=0, dtype=float)[beside] for each in (light - 1, thrown))
            share = np.float32(_share(more, by))
            presses.append(press._replace(light=press.light - share * self.flat * thrown))
        return self._replace(presses=presses or self.presses)


def _share(light: F8, by: F8) -> float:
    """Return the share of some light in another, which also drifts: robust least squares."""
    slopes = np.column_stack([by, np.ones_like(by)]) / LIGHT_DEVIATION
    away = light / LIGHT_DEVIATION
    share, _ = least_squares(lambda u: slopes @ u - away, np.zeros(2), jacobian=lambda _: slopes)
    return float(np.clip(share, 0, 1))


def _led_light(flat: F4, ambient: float) -> F4:
    return np.asarray(np.maximum(flat - np.float32(ambient), 0), np.float32)
