"""The calibration of a one-shot sensor: every value that it has, declared once."""

from pathlib import Path
from typing import Annotated, NamedTuple

from pydantic import AfterValidator

from tactograph.rings.oneshot.nodes.map.raise_walls import WallGain
from tactograph.rings.oneshot.nodes.map.reflectance_map import ReflectanceMap
from tactograph.rings.oneshot.nodes.map.slope_in_shadow import MattDeviation
from tactograph.sdk import CheckRanks, Dark, FileKind, Lens, Light, Mask, Misfit, PixelSize, Stored


class PressCalibration(NamedTuple):
    """All that a reconstruction needs to know of a one-shot sensor.

    The camera's black level is taken to be 0, and the misfit, the gain of walls and the
    deviation of a matt film follow from the quality.
    """

    flat: Annotated[Light, Stored(-0.05, 100), "the film at rest, fraction of full scale"]
    dark: Dark
    pixel_size: Annotated[PixelSize, "mm/px"]
    reflectance: Annotated[
        ReflectanceMap,
        Stored(-1e6, 1e6),
        "light less 1 (the film at rest) per x, y, z - 1, xy, xz, yz, xx - yy, 3zz - 3 of the "
        "unit normal and per mm of height; times 1, u, v, uu, uv, vv, ... to degree 4, u and v "
        "being x and y in px from the image's middle divided by half its width",
    ]
    misfit: Misfit
    quality: Annotated[dict[str, float], "figures of the calibration's quality, for people"]
    doubts: Annotated[list[str], "what speaks against the calibration, a sentence each"]
    area: Annotated[Mask, Stored(0, 1, plain=1), "1 where the frame shows film"]
    lens: Annotated[
        Lens,
        Stored(-10, 10, plain=0.0),
        "k1 k2 cx cy a b gx gy: how the camera departs from an even grid",
    ]
    serial: Annotated[str, "the camera's serial number, if it has one"] | None = None
    ranks: CheckRanks | None = None
    walls: WallGain = 0.0
    matt: MattDeviation = 0.0


PRESS_CALIBRATION = FileKind(
    "press calibration",
    1,
    "run calibrate_presses",
    PressCalibration,
    sources="the images, the pixel size, and the ball's place and radius",
    users="one-shot sensors: gelsight_mini, recalibrate_oneshot",
)
NewPressCalibration = Annotated[Path, AfterValidator(PRESS_CALIBRATION.new_file)]
