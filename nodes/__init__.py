"""The optics, one file per node, and the quantities that flow between the nodes.

Axes: x right, y down, z towards the camera.  Height is in mm above the film at rest.  Slope
is dimensionless (mm per mm).  Light is the irradiance that one LED causes: 0 to 1 of full
scale as captured, 1 on the film at rest once divided by the flat field.  LEDs are numbered
from 1; K is their number.

The text beside a quantity's port is its meaning on the page of every node that has such a port.  A
node's docstring adds only what is specific to the node, or ``name : shape in unit``.
"""

from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.graph.declare.ports import Port
from tactograph.nodes.stored import Stored, with_plain

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I4 = NDArray[np.int32]
U1 = NDArray[np.uint8]

Light = Annotated[F4, Port("K H W", "1"), "Irradiance per LED (the paper's I_k)"]
Dark = Annotated[F4, Port("H W", "1", high=0.05), "Image with all LEDs off"]
Slope = Annotated[
    F4,
    Port("2 H W", "mm/mm", low=-2, high=2),
    "Gradient (p, q) = (dz/dx, dz/dy): the paper's G, equation 2",
]
Height = Annotated[F4, Port("H W", "mm", low=-1, high=5), "Height z above the film at rest"]
RestHeight = Annotated[F4, Port("R C", "mm", low=0, high=3)]
"""Height of the film at rest, on pixels of its own or those of the images."""
CoarseLight = Annotated[F4, Port("K h w", "1")]
"""Light averaged over cells of pixels, see `coarsen`."""
CoarseDark = Annotated[F4, Port("h w", "1", high=0.05)]
"""Image with all LEDs off, averaged over cells."""
CoarseHeight = Annotated[F4, Port("h w", "mm", low=-1, high=5)]
"""Height of cells."""
HeightError = Annotated[F4, Port("H W", "mm", high=0.1), "Standard deviation of the height"]
DEVIATIONS_PER_MAD = 1.4826
"""Ratio of the standard deviation of a normal variable to its median magnitude."""
BAND_DEVIATIONS = 1.645
"""Half-width, in standard deviations, of the band that holds 90 % of a normal distribution."""
FALSE_ALARMS = 0.01
"""Share of valid input that may be doubted."""
UM_PER_MM = 1e3
METRES_PER_MM = 1e-3
Labels = Annotated[
    U1,
    Port("H W", "LED bits", high=255),
    "One bit per LED: bit k-1 stands for LED k",
]
Confidence = Annotated[F4, Port("H W", "1", high=1)]
"""Probability that a pixel's labels are right."""
Contacts = Annotated[U1, Port("H W", "contact number", high=2)]
"""The number of the contact that a pixel belongs to, from 1; 0: none."""
Mask = Annotated[U1, Port("H W", "flag", high=1), "1 where a pixel counts, else 0"]
MIN_PIXEL_MM, MAX_PIXEL_MM = 1e-6, 1.0
"""Range of pixel sizes of heights in files; a size outside is in another unit, such as um."""
MIN_OPTICAL_MM = 1e-4
"""Side of a pixel, in mm, below which no lens resolves it: a fifth of the wavelength of light."""
PixelSize = Annotated[
    float,
    Port(unit="mm/px", low=0.01, high=0.2),
    Interval(ge=MIN_OPTICAL_MM, le=MAX_PIXEL_MM),
    Stored(MIN_OPTICAL_MM, 1e3),
    "Side of a pixel on the film",
]
Albedo = Annotated[float, Port(unit="1", high=0.95), "Share of the light that the film reflects"]
Still = Annotated[float, Port(unit="1", low=0, high=1), "1 where nothing has moved, else 0"]
Vergence = Annotated[float, Port(unit="1/mm", high=0.02)]
"""1 / D, with D the height of the camera's pupil above the film; 0 for an orthographic camera."""
MIN_CAMERA_MM = 5.0
"""Least height of a camera's pupil above the film, in mm; one below is stated in another unit."""
LightPlaces = Annotated[F4, Port("8 K 3", "mm")]
"""Eight sets of LED positions that span the calibration's uncertainty: the mean square of their
effects is the variance that it causes."""
Lens = Annotated[
    F4,
    Port("8", "1", low=-0.05, high=0.05),
    "(k1, k2, cx, cy, a, b, gx, gy): the lens's departure from an even grid, see `optics.lens`; "
    "all zero for an ideal lens",
]
Grain = Annotated[float, Port(unit="1", high=0.03)]
"""Standard deviation of the light from its model beyond camera noise, as a share of the light."""
Diffuse = Annotated[F4, Port("K", "1", high=0.4)]
"""b_k: share of each LED's light that the gel diffuses."""
Refraction = Annotated[float, Port(unit="1", low=1, high=1.6)]
"""Refractive index of the film's coat; 1: none."""
Wrap = Annotated[float, Port(unit="1", high=0.3)]
"""w: how far light continues to fall behind the terminator (`optics.near_light.wrapped`)."""
ScaleError = Annotated[float, Port(unit="1", high=2)]
"""Relative error that all heights share, if nothing confirms a radius or a pixel size."""
LabelTurn = Annotated[float, Port(unit="rad", high=1)]
"""Angle by which leaving out LEDs has to turn a normal (`label_lights`)."""
Uneven = Annotated[float, Port(unit="1", high=0.05)]
"""Standard deviation of the brightness of touched film from its model, the same for all LEDs."""
ZeroError = Annotated[float, Port(unit="mm", high=1)]
"""Standard deviation of a height's zero, the same for all pixels."""
Misfit = Annotated[F4, Port("5", "1", low=0.001, high=0.02)]
"""(level, width, light, bounce, tilt): errors of the film's model, apart from noise.

- level: standard deviation of a normal, in radians.
- width: distance in mm over which errors of the normals are correlated.
- light: standard deviation of an LED's light, relative to a matt film at rest.
- bounce: relative error of the light reflected from film to film.
- tilt: error of the slant, in radians, that all normals of an object share."""
FULL_MISFIT_SLOPE = np.float32(0.1)
"""Slope above which film counts as touched and has the full model error of the presses."""
LEVEL_MISFIT_SHARE = np.float32(0.3)
"""Share of that error on level film around a touch, where the flat frame cancels all but the effect
of light that the touch throws on the film."""
NullVector = Annotated[F4, Port("K", "1", low=-1, high=1)]
"""The vector a of equation 11, of unit length."""
Spread = Annotated[float, Port(unit="1", low=0.001, high=0.1)]
"""Standard deviation of a light, or of a.I, on lit pixels."""
Reflectance = Annotated[F4, Port("K 9", "1", low=-0.3, high=0.3)]
"""Spherical-harmonic coefficients of each LED's reflectance (equation 4)."""
Metrics = dict[str, float]
"""Named figures, as in result.json; a yes or no is a bool."""
LightPositions = Annotated[
    F4,
    Port("K 3", "mm", low=-200, high=200),
    "One LED per row: (x, y, z) in mm from the centre of the image on the film at rest",
]
Noise = Annotated[
    F4,
    Port("2", "1", low=1e-6, high=1e-4),
    "(shot, read): the variance of a captured light I is shot * I + read",
]
NoiseCorrelation = Annotated[float, Port(unit="1", low=1, high=4)]
"""Variance of a mean over pixels, relative to that with independent noise."""
Blur = Annotated[float, Port(unit="px", high=1.5)]
"""Standard deviation by which the camera spreads a point, beyond the pixel itself."""
SlopeVariance = Annotated[F4, Port("2 H W", "1", low=1e-6, high=1)]
"""Variance of p and of q due to noise of the light; 1e12 where the slope is unknown."""
LutLight = Annotated[F4, Port("N K", "1")]
"""Light of the calibration pixels: the tables' keys."""
LutSlope = Annotated[F4, Port("N 2", "mm/mm", low=-2, high=2)]
"""Slope of the calibration pixels: the tables' values."""
LutLit = Annotated[U1, Port("N", "LED bits", high=255)]
"""The LEDs that reach each calibration pixel; they determine its tables."""


def robust_deviation(
    residual: NDArray[Any], axis: int | None = None, *, keepdims: bool = False
) -> Any:
    """Return the standard deviation of residuals about zero, from the median of their sizes."""
    return DEVIATIONS_PER_MAD * np.median(np.abs(residual), axis=axis, keepdims=keepdims)


class Tables(NamedTuple):
    """The tables of a calibration (`build_lut`)."""

    lut_light: LutLight
    lut_slope: LutSlope
    lut_lit: LutLit


class KnownSlopes(NamedTuple):
    """The slopes of an object of known shape, and the pixels where they are valid."""

    slope: Slope
    mask: Mask


OTHER_PLACES = 8
"""Number of alternative positions of all LEDs within a fit's error; their squares add up to it."""
USUAL_RIM_MM = 2.0
"""Assumed width of the film beyond the frame if it is unknown."""


class Film(NamedTuple):
    """LEDs, film and camera: everything that relates light to the surface (`optics/film`).

    A calibration keeps all of it; files without a film's model were made for a matt film and a far
    camera.
    """

    lights: Annotated[
        LightPositions,
        Stored(-1e8, 1e8),
        "mm, x y z per LED, from the middle of the image on the film at rest",
    ]
    other_lights: Annotated[
        LightPlaces,
        Stored(-1e8, 1e8, plain="lights"),
        "mm, other places of the LEDs that the fit allows",
    ]
    diffuse: Annotated[
        Diffuse,
        Stored(0, 0.99, plain=0.0),
        "b_k, share of an LED's light that the gel diffuses",
    ]
    wrap: Annotated[
        Wrap,
        Stored(0, 1, plain=0.0),
        "w, how far light keeps falling beyond the terminator, over that from the LED",
    ]
    harmonics: Annotated[
        F4,
        Port("K 8 6", "1", low=-0.05, high=0.05),
        Stored(-100, 100, plain=0.0),
        "harmonics x y z-1 xy xz yz xx-yy 3(zz-1) of the unit normal, by 1 u v uu uv vv",
    ]
    flattest: Annotated[
        float,
        Port(unit="n_z", low=0.3, high=0.9),
        Stored(0, 1, plain=1.0),
        "smallest n_z that was pressed",
    ]
    pressed_slope: Annotated[
        float,
        Port(unit="mm/mm", low=0.3, high=2),
        Stored(0, 1e3, plain=0.0),
        "mm/mm, steepest slope that was pressed; 0: not known",
    ]
    reach: Annotated[
        float,
        Port(unit="mm", low=5, high=20),
        Stored(1e-6, 1e6, plain=1.0),
        "mm, half the width of the film that the camera sees, the unit of u and v",
    ]
    gain: Annotated[
        float,
        Port(unit="1", low=0.95, high=1.1),
        Stored(0.1, 10, plain=1.0),
        "light of touched film relative to untouched film",
    ]
    contact: Annotated[
        float,
        Port(unit="mm", low=0.02, high=0.2),
        Stored(1e-9, 1e3, plain=0.05),
        "mm, height from which film counts as touched",
    ]
    base: Annotated[
        float,
        Port(unit="1", low=0.3, high=1),
        Stored(1e-3, 1e3, plain=1.0),
        "k_d, albedo of the matt base under the coat",
    ]
    roughness: Annotated[
        float,
        Port(unit="1", low=0.1, high=0.5),
        Stored(0.01, 10, plain=0.2),
        "Beckmann's alpha of the coat",
    ]
    refraction: Annotated[
        Refraction,
        Stored(1, 10, plain=1.0),
        "refractive index of the coat; 1: none",
    ]
    albedo: Annotated[
        Albedo, Stored(0, 0.95, plain=0.0), "rho, share of light that the film throws back"
    ]
    rim: Annotated[
        float,
        Port(unit="mm", low=0, high=4),
        Stored(0, 1e3, plain=USUAL_RIM_MM),
        "mm of film beyond the frame",
    ]
    camera: Annotated[
        Vergence,
        Stored(0, 1 / MIN_CAMERA_MM, plain=0.0),
        "1/mm, one over the pupil's height; 0: far",
    ]
    emission: Annotated[
        float,
        Port(unit="1", low=0, high=2),
        Stored(-1, 100, plain=0.0),
        "m: the LEDs emit as cos^m of the angle from their axes",
    ]
    aim: Annotated[
        float,
        Port(unit="1", low=-0.5, high=1),
        Stored(-10, 10, plain=0.0),
        "s: LEDs at x y z emit along (s - 1) x, (s - 1) y, -z; 0: to the middle, 1: straight down",
    ]
    grain: Annotated[
        Grain,
        Stored(0, 1, plain=0.0),
        "light departs by this share, beyond the camera's noise: texture, dirt, the model's errors",
    ]
    uneven: Annotated[
        Uneven,
        Stored(0, 1, plain=0.03),
        "brightness of touched film departs by this share, under all LEDs alike",
    ]

    @property
    def lights_itself(self) -> bool:
        """Whether the film shows light reflected from other parts of the film."""
        return self.refraction > 1 or self.albedo > 0

    @classmethod
    def matt(cls, lights: NDArray[Any]) -> Self:
        """Return the simplest film: nothing diffused, no harmonics, an orthographic camera."""
        return cls(**with_plain(cls, {"lights": lights}))

    def stored(self) -> Self:
        """Return the film in the types of a file: 32-bit arrays, and numbers."""
        typed: dict[str, Any] = {
            name: np.asarray(value, np.float32) if np.ndim(value) else float(value)
            for name, value in self._asdict().items()
        }
        return type(self)(**typed)


class ShadowRises(NamedTuple):
    """C heights measured by shadows: pixel `top` lies `rise` above pixel `foot`."""

    top: Annotated[I4, Port("C", "pixel number")]
    foot: Annotated[I4, Port("C", "pixel number")]
    rise: Annotated[F4, Port("C", "mm")]
    led: Annotated[U1, Port("C", "LED number")]

    @classmethod
    def none(cls) -> Self:
        """Return the rises of a touch without shadow: C = 0."""
        nowhere = np.zeros(0, np.int32)
        return cls(nowhere, nowhere, np.zeros(0, np.float32), np.zeros(0, np.uint8))
