# ruff: noqa: E501  (a row of the table is a line)
"""Wrong inputs: `KINDS`, a row a kind, each made of a valid input by a small function.

The function takes what is spoilt, how strongly, and the scene.  What is spoilt are the camera's
`images` (K x H x W, 0..1), the `light` before the camera adds its noise, the places of the `leds`
or the `recipe` of a calibration; a `surface` and a `sensor` are made from nothing.  It may return
images together with another true height.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import cv2
import numpy as np

from silent.calibrations import F4, Recipe, bytes_of
from silent.rigs import Rig
from tactograph.nodes.simulate.shape_ball import shape_ball
from tactograph.rings.shapes.nodes.shape_cone import shape_cone
from tactograph.rings.shapes.nodes.shape_pyramid import shape_pyramid


class Scene(NamedTuple):
    """What a kind may know: the untouched film, another touch, the true height, the sensor."""

    rest: F4
    other: F4
    height: F4
    rig: Rig
    rng: np.random.Generator


class Kind(NamedTuple):
    """What a row says, its strengths from weak to strong, and how it is made.

    `sensors` is all, leds or colour.  What no light can tell is not `detectable`.
    """

    says: str
    strengths: tuple[Any, ...]
    make: Callable[[Any, Any, Scene], Any]
    spoils: str = "images"
    sensors: str = "all"
    detectable: bool = True


def swap(images: F4, first: int, second: int) -> F4:
    order, count = np.arange(len(images)), len(images)
    order[[first % count, second % count]] = order[[second % count, first % count]]
    return images[order]


def with_led(images: F4, number: int, plane: Any) -> F4:
    """The images with another one of an LED."""
    out = images.copy()
    out[number % len(out)] = plane
    return out


def each(images: F4, change: Callable[[Any], Any]) -> F4:
    """Images that OpenCV has changed one by one."""
    return np.stack([change(plane) for plane in images]).astype(np.float32)


def each_of_bytes(images: F4, change: Callable[[Any], Any]) -> F4:
    return each(bytes_of(images), change) / 255


def warped(images: F4, matrix: Any) -> F4:
    """Images under a 2 x 3 matrix from new to old pixels."""
    size, flags = images.shape[:0:-1], cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    edge, matrix = cv2.BORDER_REPLICATE, np.array(matrix, float)
    return each(images, lambda p: cv2.warpAffine(p, matrix, size, flags=flags, borderMode=edge))


def shifted(images: F4, x: float, y: float = 0.0) -> F4:
    return warped(images, [[1, 0, -x], [0, 1, -y]])


def turned(images: F4, degrees: float, scale: float = 1.0) -> F4:
    """Turned and enlarged about the middle."""
    middle = (images.shape[2] - 1) / 2, (images.shape[1] - 1) / 2
    return warped(images, cv2.getRotationMatrix2D(middle, degrees, 1 / scale))


def wider(images: F4, percent: float) -> F4:
    """Stretched along x about the middle."""
    share = percent / 100
    return warped(images, [[1 - share, 0, share * (images.shape[2] - 1) / 2], [0, 1, 0]])


def seen_by(camera: Callable[..., F4], images: F4, s: float, c: Scene) -> tuple[F4, F4]:
    """What a camera in another place sees, and the height that it sees."""
    return camera(images, s), camera(c.height[None], s)[0]


def renamed(images: F4, azimuth_deg: Any, seen_deg: Any) -> F4:
    """Images in the order of the LEDs at which those that are seen at `seen_deg` now appear."""
    apart = np.abs((azimuth_deg[:, None] - seen_deg[None] + 180) % 360 - 180)
    return images[np.argmin(apart, axis=1)]


def mixed(images: F4, share: float, others: Any) -> F4:
    return np.asarray((1 - share) * images + share * others, np.float32)


def lower(images: F4, share: float, others: Any) -> F4:
    """Others in the lower share of the frames."""
    out, row = images.copy(), int((1 - share) * images.shape[1])
    out[:, row:] = np.broadcast_to(others, out.shape)[:, row:]
    return out


def interlaced(images: F4, every: int, c: Scene) -> F4:
    out = images.copy()
    out[:, ::every] = c.other[:, ::every]
    return out


def motion(images: F4, px: float, c: Scene) -> F4:
    """The touch moves from flash to flash; the film's own light stays where it is."""
    light = images / np.maximum(c.rest, 1e-3)
    return np.concatenate([shifted(p[None], px * k) for k, p in enumerate(light)]) * c.rest


def row_offset(images: F4, s: float, c: Scene) -> F4:
    rows = np.sin(0.7 * np.arange(images.shape[1]) + c.rng.uniform(0, 6, (len(images), 1)))
    return images + np.float32(s) * rows[:, :, None].astype(np.float32)


def across(images: F4) -> list[F4]:
    """x and y of the pixels, -1 to 1."""
    rows, columns = (np.linspace(-1, 1, n, dtype=np.float32) for n in images.shape[-2:])
    return list(np.meshgrid(columns, rows))


def gel(light: F4, s: float, c: Scene) -> F4:
    rough = cv2.GaussianBlur(c.rng.normal(size=light.shape[1:]), (0, 0), 6)
    return light * np.maximum(1 + s * rough / rough.std(), 0.2).astype(np.float32)


def on_touch(c: Scene) -> list[int]:
    """x and y of a pixel where the film is touched."""
    rows, columns = np.nonzero(c.height >= 0.3 * c.height.max())
    one = c.rng.integers(len(rows))
    return [int(columns[one]), int(rows[one])]


def dirt(light: F4, darkness: float, c: Scene) -> F4:
    shade = np.zeros(light.shape[1:], np.float32)
    for radius in (2, 3, 4, 5):
        cv2.circle(shade, on_touch(c), radius, 1.0, -1)
    return light * (1 - darkness * cv2.GaussianBlur(shade, (0, 0), 1.0))


def hair(light: F4, width: int, c: Scene) -> F4:
    shade, (x, y), span = np.zeros(light.shape[1:], np.float32), on_touch(c), light.shape[2] // 3
    cv2.ellipse(shade, (x, y + span // 2), (span, span // 2), 10, 180, 340, 1.0, width)
    return light * (1 - 0.8 * cv2.GaussianBlur(shade, (0, 0), 0.7))


def surface(form: Callable[[Any, Any], Any]) -> Callable[[Any, float, Scene], F4]:
    """A height in mm of a form over x, y in mm, times the strength."""
    return lambda _, s, c: np.asarray(s * form(*c.rig.grid()), np.float32)


def walls(_: None, rise_mm: float, c: Scene) -> F4:
    """Half a ball on a block."""
    x, y = c.rig.grid()
    block = (np.abs(x) < np.ptp(x) / 4) & (np.abs(y) < np.ptp(y) / 4)
    ball = shape_ball(radius_mm=0.1 * np.ptp(x), **c.rig.canvas).height
    return np.asarray((rise_mm + ball) * block, np.float32)


def swapped_recipe(recipe: Recipe, s: int, c: Scene) -> Recipe:
    balls = np.stack([swap(ball, s, s + 1) for ball in recipe.balls])
    return recipe._replace(balls=balls, flat=swap(recipe.flat, s, s + 1))


def not_square(recipe: Recipe, s: float, c: Scene) -> Recipe:
    balls, flat = np.stack([wider(ball, s) for ball in recipe.balls]), wider(recipe.flat, s)
    return recipe._replace(balls=balls, flat=flat, seen=lambda images: wider(images, s))


def another_object(_: Recipe, s: str, c: Scene) -> Recipe | None:
    shapes = {
        "cone": lambda: shape_cone(radius_mm=4.0, rise_mm=1.5, **c.rig.canvas),
        "pyramid": lambda: shape_pyramid(inradius_mm=3.5, rise_mm=1.5, **c.rig.canvas),
        "disc": lambda: shape_cone(radius_mm=4.0, rise_mm=1.5, top_radius_mm=3.4, **c.rig.canvas),
    }
    return c.rig.recipe_of([shapes[s]().height for _ in c.rig.balls()])


def gamma_recipe(recipe: Recipe, s: float, c: Scene) -> Recipe:
    return recipe._replace(balls=recipe.balls ** (1 / s), flat=recipe.flat ** (1 / s))


def touch_in_flat(recipe: Recipe, s: float, c: Scene) -> Recipe:
    return recipe._replace(flat=mixed(recipe.flat, s, c.other))


SIBLINGS = {
    "far": "near",
    "near": "far",
    "hand": "near",
    "raytraced_far28": "raytraced_near33",
    "raytraced_near33": "raytraced_far28",
}
"""The sensor whose calibration somebody may take for a sensor's own."""

# fmt: off
KINDS = {
    # The order of the images, and how they lie.
    "swapped_neighbours": Kind("neighbouring LEDs swapped", (0, 1, 2), lambda i, s, c: swap(i, s, s + 1), sensors="leds"),
    "swapped_opposite": Kind("opposite LEDs swapped", (0, 1), lambda i, s, c: swap(i, s, s + len(i) // 2), sensors="leds"),
    "order_rotated": Kind("the LEDs' order rotated", (1, -1, 2), lambda i, s, c: np.roll(i, s, 0)),
    "order_reversed": Kind("the order reversed (rgb for bgr)", (1,), lambda i, s, c: i[::-1].copy()),
    "mirrored": Kind("mirrored about an axis of the image", (2, 1), lambda i, s, c: np.flip(i, s).copy()),
    "turned_180": Kind("turned by 180 degrees", (180,), lambda i, s, c: i[:, ::-1, ::-1].copy()),
    "mirrored_renamed": Kind("mirrored, with LEDs renamed to match", (1,), lambda i, s, c: renamed(
        i[:, :, ::-1], c.rig.azimuth_deg, 180 - c.rig.azimuth_deg), sensors="leds", detectable=False),
    "turned_renamed": Kind("turned, with LEDs renamed to match", (180,), lambda i, s, c: renamed(
        i[:, ::-1, ::-1], c.rig.azimuth_deg, 180 + c.rig.azimuth_deg), sensors="leds", detectable=False),
    "zoomed": Kind("zoomed by per cent", (1, 3, 6), lambda i, s, c: turned(i, 0, 1 + s / 100), detectable=False),
    "sheared": Kind("sheared by px, by a rolling shutter", (1, 3, 6), lambda i, s, c: warped(i, [[1, s / i.shape[1], 0], [0, 1, 0]]), detectable=False),
    "camera_turned": Kind("camera turned by degrees", (1, 3, 8), lambda i, s, c: seen_by(turned, i, s, c)),
    "camera_shifted": Kind("camera shifted by px", (3, 8, 20), lambda i, s, c: seen_by(shifted, i, s, c)),
    # The camera's settings, and what a driver makes of its values.
    "gamma": Kind("a gamma of 1/s", (1.15, 1.5, 2.2), lambda i, s, c: i ** (1 / s)),
    "gamma_inverse": Kind("a gamma of s", (1.1, 1.5, 2.2), lambda i, s, c: i**s),
    "flat_gamma": Kind("the untouched film, gamma 1/s", (1.2, 1.5, 2.2), lambda i, s, c: (c.rest ** (1 / s), 0 * c.height)),
    "flat_gamma_inverse": Kind("the untouched film, gamma s", (1.2, 1.5, 2.0), lambda i, s, c: (c.rest**s, 0 * c.height)),
    "underexposed": Kind("exposure times s", (0.15, 0.05, 0.02), lambda i, s, c: i * s, "light"),
    "overexposed": Kind("exposure times s, saturated", (1.3, 1.8, 3.0), lambda i, s, c: np.clip(i * s, 0, 1), "light"),
    "clipped": Kind("values end at a share of the brightest", (0.8, 0.7, 0.6), lambda i, s, c: np.minimum(i, s * i.max())),
    "wrapped": Kind("values times s wrap round at full scale", (1.3, 1.6, 2.5), lambda i, s, c: i * s % 1),
    "few_bits": Kind("bits of a value", (6, 5, 4), lambda i, s, c: np.floor(i * 255 / 2 ** (8 - s)) * 2 ** (8 - s) / 255),
    "jpeg": Kind("JPEG of quality s", (50, 20, 8), lambda i, s, c: each_of_bytes(i, lambda p: cv2.imdecode(
        cv2.imencode(".jpg", p, [cv2.IMWRITE_JPEG_QUALITY, s])[1], cv2.IMREAD_GRAYSCALE))),
    "clahe": Kind("local contrast (CLAHE) to limit s", (1, 2, 4), lambda i, s, c: each_of_bytes(i, cv2.createCLAHE(s, (8, 8)).apply)),
    "sharpened": Kind("sharpened", (0.5, 1, 2), lambda i, s, c: i + s * (i - each(i, lambda p: cv2.GaussianBlur(p, (0, 0), 2)))),
    "median": Kind("median over px", (5, 9, 15), lambda i, s, c: each_of_bytes(i, lambda p: cv2.medianBlur(p, s))),
    "blurred": Kind("blurred by px", (1, 2, 4), lambda i, s, c: each(i, lambda p: cv2.GaussianBlur(p, (0, 0), s))),
    "counts_added": Kind("counts of 255 added", (5, 13, 25), lambda i, s, c: i + np.float32(s / 255)),
    "counts_taken": Kind("counts of 255 taken off", (5, 13, 25), lambda i, s, c: i - np.float32(s / 255)),
    "row_offset": Kind("a rolling offset per row", (0.01, 0.03, 0.06), row_offset),
    "dead_lines": Kind("a share of the rows is dead", (0.01, 0.05, 0.2), lambda i, s, c: i * np.float32(c.rng.random(i.shape[1]) > s)[:, None]),
    "white_balance": Kind("gains of the images, apart by a share", (0.05, 0.2, 0.5), lambda i, s, c: i * np.linspace(1, 1 - s, len(i), dtype=np.float32)[:, None, None]),
    "grey": Kind("a share of the images is their mean", (0.3, 0.6, 1.0), lambda i, s, c: mixed(i, s, i.mean(0))),
    "all_alike": Kind("all images are the first", (1,), lambda i, s, c: np.repeat(i[:1], len(i), 0)),
    "negative": Kind("negative of the second image; of all", (1, 2), lambda i, s, c: with_led(i, 1, 1 - i[1]) if s == 1 else 1 - i),
    "knee": Kind("values above s are flattened to 0.4", (0.8, 0.7, 0.5), lambda i, s, c: np.minimum(i, s) + np.float32(0.4) * np.maximum(i - s, 0)),
    "mosaic": Kind("a colour mosaic read as grey, darker by", (0.1, 0.2, 0.4), lambda i, s, c: i * np.float32(1 - s * (np.add(*np.indices(i.shape[1:])) % 2))),
    "hot_pixels": Kind("a share of the pixels at full scale", (0.003, 0.01, 0.03), lambda i, s, c: np.where(c.rng.random(i.shape[1:]) < s, np.float32(1), i)),
    "flicker": Kind("bands of the lamps over the rows, by a share", (0.05, 0.1, 0.2), lambda i, s, c: i * np.float32(1 + s * np.sin(0.3 * np.arange(i.shape[1]) + np.arange(len(i))[:, None]))[:, :, None]),
    "floats_of_255": Kind("Python: floats of 0 to 255", (255,), lambda i, s, c: bytes_of(i).astype(np.float32)),
    "bytes_in_words": Kind("Python: 8-bit values as uint16", (8,), lambda i, s, c: bytes_of(i).astype(np.uint16)),
    # Images that do not belong together.
    "foreign_led": Kind("a share of one image is of another touch", (0.3, 0.6, 1.0), lambda i, s, c: with_led(i, 1, mixed(i[1], s, c.other[1]))),
    "led_twice": Kind("an LED's image for the next one's, too", (0, 1, 2), lambda i, s, c: with_led(i, s + 1, i[s])),
    "led_shifted": Kind("one image shifted by px", (1, 2, 4), lambda i, s, c: with_led(i, 1, shifted(i[1:2], s, s / 2)[0])),
    "two_touches": Kind("mean with another touch, its share", (0.1, 0.3, 0.5), lambda i, s, c: mixed(i, s, c.other)),
    "ghost": Kind("mean with the untouched film, its share", (0.1, 0.3, 0.6), lambda i, s, c: mixed(i, s, c.rest)),
    "interlaced": Kind("every s-th line of another touch", (8, 4, 2), interlaced),
    "torn": Kind("the lower share shows the next LED", (0.1, 0.3, 0.6), lambda i, s, c: lower(i, s, np.roll(i, -1, 0))),
    "lower_black": Kind("the lower share is black", (0.1, 0.25, 0.5), lambda i, s, c: lower(i, s, 0)),
    "still_untouched": Kind("so many images of the untouched film", (1, 2, 3), lambda i, s, c: np.where(np.arange(len(i))[:, None, None] < min(s, len(i) - 1), c.rest, i)),
    "motion": Kind("motion in px from flash to flash", (1, 2, 3), motion),
    # Light.
    "ambient": Kind("the room's light, share of full scale", (0.02, 0.05, 0.08), lambda i, s, c: i + np.float32(s), "light"),
    "window": Kind("the room's light from one side", (0.02, 0.06, 0.15), lambda i, s, c: i + s * (1 + across(i)[0]), "light"),
    "led_dead": Kind("an LED dead, or nearly", (0.1, 0.03, 0.0), lambda i, s, c: with_led(i, 1, i[1] * s), "light"),
    "led_dim": Kind("an LED's brightness", (0.8, 0.65, 0.5), lambda i, s, c: with_led(i, 0, i[0] * s), "light"),
    "led_fades": Kind("an LED fades over the rows by a share", (0.1, 0.3, 0.6), lambda i, s, c: with_led(i, 0, i[0] * (1 - s * (1 + across(i)[1]) / 2)), "light"),
    "two_leds": Kind("an LED shines with another, by a share", (0.1, 0.3, 1.0), lambda i, s, c: with_led(i, 0, i[0] + s * i[1]), "light"),
    "leds_knocked": Kind("the LEDs knocked aside by mm", (2, 6, 20), lambda i, s, c: i + np.float32([s, -s / 2, 0]), "leds"),
    "another_gel": Kind("another film: brighter and darker by a share", (0.02, 0.05, 0.15), gel, "light"),
    "dirt": Kind("dirt on the lens over the touch, its darkness", (0.3, 0.6, 0.9), dirt, "light"),
    "hair": Kind("a hair over the touch, px", (1, 2, 4), hair, "light"),
    "veil": Kind("a veil: a share is blurred by 15 px", (0.1, 0.2, 0.4), lambda i, s, c: mixed(i, s, each(i, lambda p: cv2.GaussianBlur(p, (0, 0), 15))), "light"),
    "reflection": Kind("a mirror image over the light, its share", (0.05, 0.1, 0.2), lambda i, s, c: i + np.float32(s) * i[:, :, ::-1], "light"),
    "round_view": Kind("a black frame around a round view", (1.1, 0.9, 0.7), lambda i, s, c: i * np.float32(np.hypot(*across(i)) < s), "light"),
    # Surfaces of which the light does not tell zero, tilt or walls.
    "wave": Kind("a wave over the whole frame, mm", (0.1, 0.3, 0.6), surface(lambda x, y: 1 + np.sin(1.1 * x + 0.4 * y) * np.cos(0.9 * y)), "surface"),
    "edge": Kind("an edge across the frame, mm", (0.3, 0.8, 1.5), surface(lambda x, y: 1 / (1 + np.exp(-(x + 0.3 * y) / 0.6))), "surface"),
    "tilted_plate": Kind("a tilted plate to all borders, mm", (0.3, 1.0, 2.0), surface(lambda x, y: 0.5 + 0.4 * x / np.ptp(x) + 0.3 * y / np.ptp(y)), "surface", detectable=False),
    "walls": Kind("vertical walls, mm", (0.3, 1.0, 2.5), walls, "surface"),
    "steps": Kind("steps on the film, mm", (0.002, 0.01, 0.05), surface(lambda x, y: np.floor(4 * (x / np.ptp(x) + 0.5)).clip(0, 3) * (np.abs(y) < 0.3 * np.ptp(y))), "surface"),
    # Calibrations.
    "another_sensor": Kind("another sensor's calibration", (1,), lambda _, s, c: SIBLINGS.get(c.rig.name), "sensor"),
    "radius": Kind("calibrated with the ball's radius times s", (1.03, 1.1, 6 / 7, 2.0), lambda r, s, c: r._replace(radius_mm=r.radius_mm * s), "recipe"),
    "pixel_size": Kind("calibrated with the pixel size times s", (1.03, 1.1, 2.0), lambda r, s, c: r._replace(pixel_mm=r.pixel_mm * s), "recipe"),
    "scale": Kind("calibrated with both times s", (2.0,), lambda r, s, c: r._replace(radius_mm=r.radius_mm * s, pixel_mm=r.pixel_mm * s), "recipe", detectable=False),
    "order_at_calibration": Kind("calibrated with LEDs swapped", (0, 1, 2), swapped_recipe, "recipe"),
    "order_of_balls": Kind("calibrated with LEDs swapped in the balls only", (0, 1, 2), lambda r, s, c: swapped_recipe(r, s, c)._replace(flat=r.flat), "recipe"),
    "not_square": Kind("pixels off square by per cent", (3, 6, 10), not_square, "recipe"),
    "egg": Kind("calibrated with an egg, longer by per cent", (2, 5, 10), lambda r, s, c: c.rig.recipe_of([wider(b[None], s)[0] for b in c.rig.balls()]), "recipe"),
    "another_object": Kind("calibrated with another object", ("cone", "pyramid", "disc"), another_object, "recipe"),
    "ambient_at_calibration": Kind("the room's light in the balls' images", (0.02, 0.05, 0.08), lambda r, s, c: r._replace(balls=np.clip(r.balls + np.float32(s), 0, 1)), "recipe"),
    "gamma_at_calibration": Kind("calibrated with a gamma of 1/s", (1.15, 1.5, 2.2), gamma_recipe, "recipe"),
    "touch_in_flat": Kind("a touch in the flat frame, its share", (0.1, 0.3, 1.0), touch_in_flat, "recipe"),
}
# fmt: on
