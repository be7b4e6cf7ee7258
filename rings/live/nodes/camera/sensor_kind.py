"""What a kind of sensor asks of its camera."""

from typing import Any

from tactograph.rings.live.nodes.camera.camera_params import CameraParams
from tactograph.rings.live.nodes.camera.open_camera import CameraSettings, View
from tactograph.rings.live.nodes.camera.sensor_preset import SensorPreset
from tactograph.sdk import InputError

Size = tuple[int | None, int | None]
"""Width and height of frames in px; None: the driver's."""


def pixel_on_film(mm: float | None, preset: SensorPreset | None) -> float:
    """Return the side of a pixel in mm as given, else the preset's.  Raises InputError without."""
    pixel = mm or (preset.pixel_size_mm if preset else None)
    if pixel is None:
        raise InputError(
            "the pixel size is not known; give `pixel_size_mm`=MM, or a `sensor` that states it"
        )
    return pixel


def preset_of(sensor: str | None, *, flashing: bool) -> SensorPreset | None:
    """Read the preset of a sensor whose LEDs flash, or whose colours are lit at once.

    Raises
    ------
    InputError
        If there is none of this name, or it is of the other kind.
    """
    if sensor is None:
        return None
    preset = SensorPreset.read(sensor)
    if flashing and preset.leds is None:
        raise InputError(
            f"`sensor`={sensor}: lights its colours at once, but here LEDs flash; say in its file "
            "how many (leds: 4), or take a graph of one-shot sensors"
        )
    if not flashing and preset.leds is not None:
        raise InputError(
            f"`sensor`={sensor}: its LEDs flash, but here colours are lit at once; take a graph of "
            "sensors that flash"
        )
    return preset


def film_of(preset: SensorPreset | None) -> dict[str, float]:
    """Return image and pixel size of a simulated sensor of this kind."""
    if preset is None:
        return {}
    width, height = preset.size
    return {"width_px": width, "height_px": height, "pixel_size_mm": preset.pixel_size_mm}


def camera_settings(
    driver: CameraParams, size: Size, preset: SensorPreset | None, *, colour: bool
) -> CameraSettings:
    """The settings to request from the driver, and the view of its pictures.

    Parameters
    ----------
    driver : what it states goes before the preset's settings
    size : width and height of the frames; None keeps the driver's, or the preset's
    preset, colour : of a real camera, if any; whether its colours count

    Raises
    ------
    InputError
        If the requested size differs from the preset's.
    """
    settings: dict[str, Any] = {"width": size[0], "height": size[1], "rate": driver.rate}
    if preset is not None:
        frame = size[0] or preset.size[0], size[1] or preset.size[1]
        if frame != preset.size:
            raise InputError(
                f"sensor: gives {preset.size[0]} x {preset.size[1]} pixels, but the calibration is "
                f"for {frame[0]} x {frame[1]}; calibrate with this `sensor` or change its file"
            )
        view = View(preset.turn_deg, preset.crop, frame)
        usual = preset.camera.model_dump()
        settings = {**usual, "rate": usual["rate"] or driver.rate, "view": view}
    stated = {name: getattr(driver, name) for name in ("exposure", "gain", "white_balance")}
    settings |= {name: value for name, value in stated.items() if value is not None}
    # Each was checked where it comes from; a driver may refuse more.
    return CameraSettings.model_construct(**settings, colour=colour)
