"""Write the calibration of a one-shot sensor into one file."""

from tactograph.rings.oneshot.nodes.file.press_calibration import (
    PRESS_CALIBRATION,
    NewPressCalibration,
)
from tactograph.rings.oneshot.nodes.map.reflectance_map import ReflectanceMap
from tactograph.sdk import Lens, Light, Mask, PixelSize, Provenance, SensorIdentity, node, warn


@node
def write_press_calibration(
    flat: Light,
    pixel: PixelSize,
    reflectance: ReflectanceMap,
    quality: dict[str, float],
    advice: str,
    doubts: list[str] | None = None,
    area: Mask | None = None,
    serial: str | None = None,
    lens: Lens | None = None,
    *,
    file: NewPressCalibration,
    sensor: str | None = None,
    provenance: Provenance,
) -> None:
    """Write flat, pixel size and reflectance map as one ``.npz``, readable without pickle.

    Parameters
    ----------
    flat : K x H x W, the film at rest
    pixel : mm per px
    reflectance : K x 9 x 15
    quality, advice
        From `rate_presses`.  The file stores them, and a warning repeats advice to press more.
    doubts
        What speaks against the calibration, a sentence each: every graph that uses the file
        repeats it.
    area : H x W, where the frame shows film; None: everywhere
    serial : the camera's serial number
    lens : length 8, by which the images were undistorted; None: an ideal lens
    file : the file; it is replaced as a whole
    sensor : the sensor's name, as for `write_calibration`

    Raises
    ------
    InputError
        If the calibration cannot be of a sensor, the file's name does not end in ``.npz``, or it
        cannot be written.
    """
    sensor = sensor or SensorIdentity.behind(provenance).name or None
    arrays = {"flat": flat, "pixel_size": pixel, "reflectance": reflectance, "area": area}
    judged = {"quality": quality, "advice": advice, "doubts": doubts or []}
    about = {"sensor": sensor, "serial": serial, "provenance": provenance}
    PRESS_CALIBRATION.write(file, {**arrays, "lens": lens, **judged, **about})
    if advice.startswith("press"):
        warn(advice)
