"""The pictures of a result, for people."""

from pathlib import Path

import numpy as np

from tactograph.nodes import (
    BAND_DEVIATIONS,
    F4,
    UM_PER_MM,
    Confidence,
    Contacts,
    Height,
    HeightError,
    Labels,
    Light,
)
from tactograph.nodes.drawing.chart import BLUE, Axes, Limits, Page, Scale, pixel_ends
from tactograph.nodes.drawing.led_colours import LED_COLOURS, SEVERAL_COLOUR

PLANE_SIZE_PX, HEIGHT_SIZE_PX = (704, 506), (1100, 440)
"""Width and height of the picture of a map, and of that of the height with its section."""
OVERLAY_OPACITY = 0.75
MM_LABELS, PX_LABELS = ("x / mm", "y / mm"), ("x / px", "y / px")


def draw_height(height: Height, error: HeightError | None, pixel: float, file: Path) -> None:
    """The height map in mm, and the cross-section through its highest point with its error."""
    rows, columns = height.shape
    top = int(np.unravel_index(int(np.nanargmax(height)), height.shape)[0])
    page = Page(*HEIGHT_SIZE_PX, columns=2)
    y = (top - (rows - 1) / 2) * pixel
    x, down = _borders(height, pixel)
    title = "height above the film at rest"
    left = page.axes(0, 0, x, down, title, MM_LABELS, square=True, bar=True)
    left.image(height, "viridis")
    left.line(x, [y, y], "white")
    left.colour_bar("mm")
    half = np.zeros(columns) if error is None else BAND_DEVIATIONS * error[top]
    low, high = np.nanmin(height[top] - half), np.nanmax(height[top] + half)
    space = 0.05 * (high - low)
    ends = float(low - space), float(high + space)
    title = f"section at y = {y:.2f} mm"
    right = page.axes(0, 1, x, ends, title, ("x / mm", "height / mm"), grid=True)
    across = (np.arange(columns) - (columns - 1) / 2) * pixel
    if error is not None:
        right.area(across, height[top] - half, height[top] + half, opacity=0.35)
        right.write("shaded: 90 % ", x[1], high, anchor="rm", fill=BLUE)
    right.line(across, height[top])
    page.save(file)


def draw_error(error: HeightError, pixel: float, file: Path) -> None:
    """The height's standard deviation in micrometres."""
    _draw_plane(UM_PER_MM * error, pixel, "standard deviation of the height", "um", "magma", file)


def draw_confidence(confidence: Confidence, pixel: float, file: Path) -> None:
    """The probability that the shadow labels are right."""
    _draw_plane(confidence, pixel, "shadow labels: probability of all", "", "gray", file)


def draw_seams(height: F4, source: Labels, pixel: float, file: Path) -> None:
    """The surface lit from the upper left, and the seams between the touches it is made of."""
    down, right = np.gradient(height, pixel)
    lit = (1 - right - down) / np.sqrt(1 + right**2 + down**2)
    page = Page(*PLANE_SIZE_PX)
    count = len(np.unique(source[source > 0]))
    title = f"{count} touches and their seams"
    axes = page.axes(0, 0, *_borders(height, pixel), title, MM_LABELS, square=True)
    axes.image(lit)
    edges = np.zeros(height.shape, bool)
    edges[:, 1:] |= np.diff(source.astype(int), axis=1) != 0
    edges[1:] |= np.diff(source.astype(int), axis=0) != 0
    axes.image(np.where(edges, 0, np.nan), ["red"])
    page.save(file)


def _draw_plane(plane: F4, pixel: float, title: str, unit: str, colours: Scale, file: Path) -> None:
    page = Page(*PLANE_SIZE_PX)
    axes = page.axes(0, 0, *_borders(plane, pixel), title, MM_LABELS, square=True, bar=True)
    axes.image(plane, colours)
    axes.colour_bar(unit)
    page.save(file)


def _borders(plane: F4 | Labels, pixel: float) -> tuple[Limits, Limits]:
    """The image's borders in mm from its middle: left and right, bottom and top; y runs down."""
    down, across = (side * pixel / 2 for side in plane.shape)
    return (-across, across), (down, -down)


def draw_shadow(shadow: Labels, image: Light, file: Path) -> None:
    """The shadowed LEDs over the mean image."""
    _draw_leds(shadow, image, "in shadow", file)


def draw_highlight(highlight: Labels, image: Light, file: Path) -> None:
    """The mirrored LEDs over the mean image."""
    _draw_leds(highlight, image, "mirrored", file)


def draw_contact(contact: Contacts, image: Light, file: Path) -> None:
    """The contacts over the mean image, each in a colour and with its number."""
    colours = len(LED_COLOURS)
    numbers, areas = np.unique(contact[contact > 0], return_counts=True)
    share = areas.sum() / contact.size
    title = f"{len(numbers)} contact{'' if len(numbers) == 1 else 's'}: {share:.1%} of the pixels"
    page, axes = _over_image(image, title)
    over = np.where(contact == 0, np.nan, (contact - 1.0) % colours + 1)
    axes.image(over, LED_COLOURS, (0.5, colours + 0.5), opacity=OVERLAY_OPACITY)
    for number in numbers:
        # The contact's pixel nearest to the centroid: that of a ring lies outside the contact.
        rows, columns = np.nonzero(contact == number)
        nearest = np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2)
        place = float(columns[nearest]), float(rows[nearest])
        axes.write(str(number), *place, stroke_width=3, stroke_fill="white")
    page.save(file)


def _draw_leds(bits: Labels, image: Light, label: str, file: Path) -> None:
    """A colour per LED whose bit is set, a dark one for several: untouched film is near white."""
    count = image.shape[0]
    numbers = _label_numbers(bits, count)
    title = f"{label}: {(numbers > 0).mean():.1%} of the pixels"
    page, axes = _over_image(image, title, bar=True)
    colours, over = [*LED_COLOURS[:count], SEVERAL_COLOUR], np.where(numbers > 0, numbers, np.nan)
    axes.image(over, colours, (0.5, count + 1.5), opacity=OVERLAY_OPACITY)
    axes.colour_bar(names={**{k: f"LED {k}" for k in range(1, count + 1)}, count + 1: "several"})
    page.save(file)


def _over_image(image: Light, title: str, *, bar: bool = False) -> tuple[Page, Axes]:
    """A page with the mean of a touch's images, and its axes."""
    page, mean = Page(*PLANE_SIZE_PX), image.mean(axis=0)
    axes = page.axes(0, 0, *pixel_ends(mean), title, PX_LABELS, square=True, bar=bar)
    axes.image(mean, ends=(0, float(mean.max())))
    return page, axes


def _label_numbers(shadow: Labels, count: int) -> F4:
    """0 for lit, k where LED k alone is dark, count + 1 where several are."""
    bits = np.stack([(shadow >> k) & 1 for k in range(count)]).astype(np.int64)
    dark = bits.sum(axis=0)
    single = (bits * np.arange(1, count + 1)[:, None, None]).sum(axis=0)
    return np.where(dark > 1, count + 1, single).astype(np.float32)
