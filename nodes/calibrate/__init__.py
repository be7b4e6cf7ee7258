"""Calibrate film, LEDs and noise from presses of known shape.

Each room is a task: find the balls, place the LEDs, fit the paper's tables or a film's model,
calibrate a camera, rate a calibration, draw touches from it, and write its file.  This file has
quantities and constants that several rooms share.
"""

from typing import Annotated

import numpy as np

from tactograph.graph.declare.ports import Port
from tactograph.nodes import F4, I4

BallCircles = Annotated[F4, Port("B 3", "px")]
"""x, y and contact radius of each ball."""
BallRadii = Annotated[F4, Port("B", "mm", low=1, high=3)]
"""The radius of each ball."""
BallPress = Annotated[I4, Port("B", "press number")]
"""The number of each ball's press, from 0."""

MIN_FLAT_LIGHT = np.float32(0.02)
"""Light of the film at rest below which it is not used as a divisor."""
MAX_SAMPLE_SLOPE = 3.0
"""Steepest slope of a sample; a shape is least certain where it is steep."""
SHIFT_DEVIATION_PX = 0.5
"""Standard deviation of an object's position along x and along y."""
LED_DRIFT, LED_DRIFT_ACROSS = 0.03, 0.01
"""Standard deviations of LEDs that warm up since the flat frame: of their light, and of how that
changes across half the image."""
MAX_LED_WIDTHS = 100.0
"""Distance of an LED, in widths of the image, beyond which its light is parallel."""
MIN_PIXELS = 100
"""Smallest number of pixels to which tables, a reflectance or LEDs are fitted."""
FOLD_COUNT = 4
"""Number of folds that are held out in turn: every fourth ball, or quarters of a single ball."""
MIN_BOUNCE_ERROR = 0.015
"""Smallest relative error of the light from film to film, however well presses agree.  On
ray-traced film an albedo came out 0.01 too low, with wrong LEDs; noise explains only 0.002."""
