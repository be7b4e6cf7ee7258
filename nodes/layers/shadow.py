"""The LEDs that do not reach each pixel."""

from typing import Annotated

from tactograph.nodes import Labels
from tactograph.nodes.stream.touch import LabelMap, LayerKind, Touch


def _warning(touch: Touch, shadow: Labels) -> str:
    """A warning if one of three LEDs is shadowed, since two lights allow two slopes."""
    if len(touch.image) != 3 or not shadow.any():
        return ""
    # 'precise' needs a calibration with LED positions, which also has the pupil's position.
    has_camera = touch.view.camera is not None
    cure = "a fourth LED, or 'precise', helps" if has_camera else "press less steeply"
    return (
        f"three lights, {(shadow != 0).mean():.1%} of the pixels in shadow: two lights allow two "
        f"slopes, so heights there and beyond may be wrong; {cure}"
    )


KIND = LayerKind(
    Annotated[Labels, "Bit k-1: LED k does not reach the pixel"],
    LabelMap("in shadow", leds=True),
    topics={"shadow": None},
    warning=_warning,
)
