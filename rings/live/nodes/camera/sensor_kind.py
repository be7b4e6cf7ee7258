"""What a kind of sensor asks of its camera."""

from dataclasses import replace

from tactograph.rings.live.nodes.camera.open_camera import CameraSettings, View
from tactograph.sdk import InputError
from tactograph.sdk.unstable import SensorPreset


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


def with_preset(settings: CameraSettings, preset: SensorPreset) -> CameraSettings:
    """The settings to request from the driver, and the view of its pictures.

    Raises
    ------
    InputError
        If the requested size differs from the preset's.
    """
    size = settings.width or preset.size[0], settings.height or preset.size[1]
    if size != preset.size:
        raise InputError(
            f"sensor: gives {preset.size[0]} x {preset.size[1]} pixels, but the calibration is for "
            f"{size[0]} x {size[1]}; calibrate with this `sensor` or change its file"
        )
    usual = preset.camera
    return replace(
        settings,
        width=usual.width,
        height=usual.height,
        rate=usual.rate or settings.rate,
        format=usual.format,
        exposure=usual.exposure if settings.exposure is None else settings.exposure,
        gain=usual.gain if settings.gain is None else settings.gain,
        white_balance=usual.white_balance
        if settings.white_balance is None
        else settings.white_balance,
        view=View(preset.turn_deg, preset.crop, size),
    )
