"""Wrong inputs, each a function of a right one: a row of the table `KINDS`.

An image kind takes the camera's images (K x H x W, 0..1), how strong it is, and the scene.  It
returns other images, or images and another true height.  A light kind does the same to the light
before the camera adds its noise, a surface kind makes a touch from nothing, and a calibration kind
changes what the sensor is calibrated with.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.nodes.simulate.shape_ball import shape_ball
from tactograph.nodes.simulate.shape_cone import shape_cone
from tactograph.nodes.simulate.shape_pyramid import shape_pyramid

if TYPE_CHECKING:
    from silent.rigs import Recipe, Rig

F4 = NDArray[np.float32]
LEVELS = ("weak", "middle", "strong")


class Scene(NamedTuple):
    """What a kind may know of a touch beside its images."""

    rest: F4
    other: F4
    height: F4
    rig: Rig
    rng: np.random.Generator


class Kind(NamedTuple):
    """A row's description, the function, what it acts on, and its strengths from weak to strong."""

    says: str
    make: Callable[..., Any]
    acts_on: str
    strengths: tuple[Any, ...]
    detectable: bool
    sensors: str


KINDS: dict[str, Kind] = {}
Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def kind(
    says: str, *strengths: Any, on: str = "image", detectable: bool = True, sensors: str = "all"
) -> Decorator:
    """Enter a function into the table; `sensors` is all, leds or colour."""

    def enter(make: Callable[..., Any]) -> Callable[..., Any]:
        KINDS[make.__name__] = Kind(says, make, on, strengths, detectable, sensors)
        return make

    return enter


def with_led(image: F4, number: int, plane: Any) -> F4:
    """The images with that of one LED replaced."""
    out = image.copy()
    out[number] = plane
    return out


def warped(image: F4, matrix: Any) -> F4:
    """Images under a 2 x 3 matrix from new to old pixels."""
    size, flags = image.shape[:0:-1], cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    edge = cv2.BORDER_REPLICATE
    planes = (cv2.warpAffine(p, np.float64(matrix), size, flags=flags, borderMode=edge)
              for p in image)  # fmt: skip
    return np.stack(list(planes))


def shifted(image: F4, x: float, y: float = 0.0) -> F4:
    return warped(image, [[1, 0, -x], [0, 1, -y]])


def turned(image: F4, degrees: float, scale: float = 1.0) -> F4:
    """Turned and enlarged about the middle of the image."""
    middle = (image.shape[2] - 1) / 2, (image.shape[1] - 1) / 2
    return warped(image, cv2.getRotationMatrix2D(middle, degrees, 1 / scale))


def moved(image: F4, rest: F4, x: float) -> F4:
    """The touch moved over the film, whose own light stays where it is."""
    return shifted(image / np.maximum(rest, 1e-3), x) * rest


def across(image: F4) -> tuple[F4, F4]:
    """Coordinates x, y of the pixels, -1 to 1."""
    y, x = np.meshgrid(*(np.linspace(-1, 1, n, dtype=np.float32) for n in image.shape[-2:]),
                       indexing="ij")  # fmt: skip
    return x, y


# The order of the images, and how they lie.


@kind("two neighbouring LEDs swapped", 0, 1, 2, sensors="leds")
def swapped_neighbours(image: F4, s: int, scene: Scene) -> F4:
    order = np.arange(len(image))
    order[[s, (s + 1) % len(image)]] = order[[(s + 1) % len(image), s]]
    return image[order]


@kind("two opposite LEDs swapped", 0, 1, sensors="leds")
def swapped_opposite(image: F4, s: int, scene: Scene) -> F4:
    order, other = np.arange(len(image)), s + len(image) // 2
    order[[s, other]] = order[[other, s]]
    return image[order]


@kind("the LEDs' order rotated", 1, -1, 2, sensors="leds")
def order_rotated(image: F4, s: int, scene: Scene) -> F4:
    return np.roll(image, s, axis=0)


@kind("LEDs or channels in reversed order (rgb for bgr)", 1)
def order_reversed(image: F4, s: int, scene: Scene) -> F4:
    return image[::-1].copy()


@kind("images mirrored, right for left; upside down", 2, 1)
def mirrored(image: F4, s: int, scene: Scene) -> F4:
    return np.flip(image, s).copy()


@kind("images turned by 180 degrees", 1)
def turned_180(image: F4, s: int, scene: Scene) -> F4:
    return image[:, ::-1, ::-1].copy()


def renamed(image: F4, azimuth_deg: NDArray[Any], seen_deg: NDArray[Any]) -> F4:
    """Images in the order of the LEDs at which those seen at `seen_deg` now appear."""
    apart = np.abs((azimuth_deg[:, None] - seen_deg[None] + 180) % 360 - 180)
    return image[np.argmin(apart, axis=1)]


@kind("mirrored, with LEDs renamed to match", 1, detectable=False, sensors="leds")
def mirrored_renamed(image: F4, s: int, scene: Scene) -> F4:
    azimuth = scene.rig.azimuth_deg
    return renamed(image[:, :, ::-1], azimuth, 180 - azimuth).copy()


@kind("turned by 180, with LEDs renamed to match", 1, detectable=False, sensors="leds")
def turned_renamed(image: F4, s: int, scene: Scene) -> F4:
    azimuth = scene.rig.azimuth_deg
    return renamed(image[:, ::-1, ::-1], azimuth, 180 + azimuth).copy()


@kind("zoomed by per cent", 1, 3, 6, detectable=False)
def zoomed(image: F4, s: float, scene: Scene) -> F4:
    return turned(image, 0, 1 + s / 100)


@kind("camera turned by degrees since the calibration", 1, 3, 8)
def camera_turned(image: F4, s: float, scene: Scene) -> F4:
    return turned(image, s)


@kind("camera shifted by px since the calibration", 3, 8, 20)
def camera_shifted(image: F4, s: float, scene: Scene) -> F4:
    return shifted(image, s)


# The camera's settings and what a driver makes of its values.


@kind("gamma of the images, 1/s", 1.15, 1.5, 2.2)
def gamma(image: F4, s: float, scene: Scene) -> F4:
    return image ** np.float32(1 / s)


@kind("gamma of the images, s", 1.1, 1.5, 2.2)
def gamma_inverse(image: F4, s: float, scene: Scene) -> F4:
    return image ** np.float32(s)


@kind("the untouched film with a gamma", 1.2, 1.5, 2.2)
def flat_gamma(image: F4, s: float, scene: Scene) -> tuple[F4, F4]:
    return scene.rest ** np.float32(1 / s), np.zeros_like(scene.height)


@kind("exposure times s", 0.15, 0.05, 0.02, on="light")
def underexposed(light: F4, s: float, scene: Scene) -> F4:
    return light * np.float32(s)


@kind("exposure times s, saturating", 1.3, 1.8, 3.0, on="light")
def overexposed(light: F4, s: float, scene: Scene) -> F4:
    return np.clip(light * np.float32(s), 0, 1)


@kind("values clipped at a share of the brightest", 0.8, 0.7, 0.6)
def clipped(image: F4, s: float, scene: Scene) -> F4:
    return np.minimum(image, np.float32(s) * image.max())


@kind("values that wrap round at full scale", 1.3, 1.6, 2.5)
def wrapped(image: F4, s: float, scene: Scene) -> F4:
    return image * np.float32(s) % np.float32(1)


@kind("bits of an image", 6, 5, 4)
def few_bits(image: F4, s: int, scene: Scene) -> F4:
    return np.floor(image * 255 / 2 ** (8 - s)) * 2 ** (8 - s) / np.float32(255)


@kind("JPEG of a quality", 50, 20, 8)
def jpeg(image: F4, s: int, scene: Scene) -> F4:
    coded = (cv2.imencode(".jpg", p, [cv2.IMWRITE_JPEG_QUALITY, s])[1] for p in bytes_of(image))
    return np.stack([cv2.imdecode(c, cv2.IMREAD_GRAYSCALE) for c in coded]) / np.float32(255)


def bytes_of(image: F4) -> NDArray[np.uint8]:
    return np.asarray(np.rint(np.clip(image, 0, 1) * 255), np.uint8)


@kind("local contrast (CLAHE), clip limit", 1, 2, 4)
def clahe(image: F4, s: float, scene: Scene) -> F4:
    tool = cv2.createCLAHE(s, (8, 8))
    return np.stack([tool.apply(p) for p in bytes_of(image)]) / np.float32(255)


@kind("sharpened by the camera", 0.5, 1, 2)
def sharpened(image: F4, s: float, scene: Scene) -> F4:
    soft = np.stack([cv2.GaussianBlur(p, (0, 0), 2) for p in image])
    return image + np.float32(s) * (image - soft)


@kind("median over px by the driver", 5, 9, 15)
def medianed(image: F4, s: int, scene: Scene) -> F4:
    return np.stack([cv2.medianBlur(p, s) for p in bytes_of(image)]) / np.float32(255)


@kind("out of focus, blur in px", 1, 2, 4)
def blurred(image: F4, s: float, scene: Scene) -> F4:
    return np.stack([cv2.GaussianBlur(p, (0, 0), s) for p in image])


@kind("counts of 255 added", 5, 13, 25)
def counts_added(image: F4, s: float, scene: Scene) -> F4:
    return image + np.float32(s / 255)


@kind("counts of 255 taken off (black level)", 5, 13, 25)
def counts_taken(image: F4, s: float, scene: Scene) -> F4:
    return image - np.float32(s / 255)


@kind("a rolling offset per row", 0.01, 0.03, 0.06)
def row_offset(image: F4, s: float, scene: Scene) -> F4:
    rows = np.sin(np.arange(image.shape[1]) * 0.7) + scene.rng.normal(size=(len(image), 1))
    return image + np.float32(s) * np.asarray(rows, np.float32)[:, :, None]


@kind("white balance: gains of the channels apart by a share", 0.05, 0.2, 0.5)
def white_balance(image: F4, s: float, scene: Scene) -> F4:
    gains = np.linspace(1, 1 - s, len(image), dtype=np.float32)
    return image * gains[:, None, None]


@kind("all images the mean of them (grey)", 0.3, 0.6, 1.0)
def grey(image: F4, s: float, scene: Scene) -> F4:
    return (1 - np.float32(s)) * image + np.float32(s) * image.mean(0)


@kind("all images are those of LED 1", 1)
def all_the_same(image: F4, s: float, scene: Scene) -> F4:
    return np.repeat(image[:1], len(image), axis=0)


@kind("negative of LED 2's image; of all", 1, 2)
def negative(image: F4, s: int, scene: Scene) -> F4:
    return with_led(image, 1, 1 - image[1]) if s == 1 else 1 - image


@kind("Python: floats of 0..255; 8-bit values as uint16", "float", "uint16")
def python_arrays(image: F4, s: str, scene: Scene) -> NDArray[Any]:
    values = bytes_of(image)
    return values.astype(np.float32 if s == "float" else np.uint16)


# Images that do not belong together.


@kind("a share of one LED's image from another touch", 0.3, 0.6, 1.0)
def foreign_led(image: F4, s: float, scene: Scene) -> F4:
    return with_led(image, 1, (1 - s) * image[1] + s * scene.other[1])


@kind("one LED's image in place of the next one's too", 0, 1, 2)
def led_twice(image: F4, s: int, scene: Scene) -> F4:
    return with_led(image, (s + 1) % len(image), image[s])


@kind("one image shifted by px", 1, 2, 4)
def led_shifted(image: F4, s: float, scene: Scene) -> F4:
    return with_led(image, 1, shifted(image[1:2], s, s / 2)[0])


@kind("mean of two touches, share of the other", 0.1, 0.3, 0.5)
def two_touches(image: F4, s: float, scene: Scene) -> F4:
    return (1 - np.float32(s)) * image + np.float32(s) * scene.other


@kind("mean of the touch and the untouched film (ghost)", 0.1, 0.3, 0.6)
def ghost(image: F4, s: float, scene: Scene) -> F4:
    return (1 - np.float32(s)) * image + np.float32(s) * scene.rest


@kind("every s-th line of another touch", 8, 4, 2)
def interlaced(image: F4, s: int, scene: Scene) -> F4:
    out = image.copy()
    out[:, ::s] = scene.other[:, ::s]
    return out


@kind("torn frames: the lower share shows the next LED", 0.1, 0.3, 0.6)
def torn(image: F4, s: float, scene: Scene) -> F4:
    out, row = image.copy(), int((1 - s) * image.shape[1])
    out[:, row:] = np.roll(image, -1, axis=0)[:, row:]
    return out


@kind("the lower share of the frames black", 0.1, 0.25, 0.5)
def lower_black(image: F4, s: float, scene: Scene) -> F4:
    out = image.copy()
    out[:, int((1 - s) * image.shape[1]) :] = 0
    return out


@kind("so many images still of the untouched film", 1, 2, 3)
def still_untouched(image: F4, s: int, scene: Scene) -> F4:
    out, count = image.copy(), min(s, len(image) - 1)
    out[:count] = scene.rest[:count]
    return out


@kind("motion in px from flash to flash", 1, 2, 3)
def motion(image: F4, s: float, scene: Scene) -> F4:
    each = [moved(image[k : k + 1], scene.rest[k : k + 1], s * k) for k in range(len(image))]
    return np.concatenate(each)


# Light.


@kind("light of the room in the touch, share of full scale", 0.02, 0.05, 0.08, on="light")
def ambient(light: F4, s: float, scene: Scene) -> F4:
    return light + np.float32(s)


@kind("a window beside the sensor: light from one side", 0.02, 0.06, 0.15, on="light")
def window(light: F4, s: float, scene: Scene) -> F4:
    return light + np.float32(s) * (1 + across(light)[0])


@kind("an LED dead, or nearly", 0.1, 0.03, 0.0, on="light")
def led_dead(light: F4, s: float, scene: Scene) -> F4:
    return with_led(light, 1, light[1] * np.float32(s))


@kind("an LED at a share of its brightness", 0.8, 0.65, 0.5, on="light")
def led_dim(light: F4, s: float, scene: Scene) -> F4:
    return with_led(light, 0, light[0] * np.float32(s))


@kind("an LED fades over the rows by a share", 0.1, 0.3, 0.6, on="light")
def led_fades(light: F4, s: float, scene: Scene) -> F4:
    return with_led(light, 0, light[0] * (1 - np.float32(s) * (across(light)[1] + 1) / 2))


@kind("two LEDs on at once, share of the second", 0.1, 0.3, 1.0, on="light")
def two_leds(light: F4, s: float, scene: Scene) -> F4:
    return with_led(light, 0, light[0] + np.float32(s) * light[1])


@kind("another gel: the film's own brightness departs by a share", 0.02, 0.05, 0.15, on="light")
def another_gel(light: F4, s: float, scene: Scene) -> F4:
    rough = cv2.GaussianBlur(scene.rng.normal(size=light.shape[1:]), (0, 0), 6)
    return light * np.asarray(1 + s * rough / rough.std(), np.float32).clip(0.2)


@kind("dirt on the lens over the touch, darkness", 0.3, 0.6, 0.9, on="light")
def dirt(light: F4, s: float, scene: Scene) -> F4:
    shade = np.zeros(light.shape[1:], np.float32)
    for _ in range(5):
        x, y = on_touch(scene)
        cv2.circle(shade, (x, y), int(scene.rng.integers(2, 6)), 1.0, -1)
    return light * (1 - np.float32(s) * cv2.GaussianBlur(shade, (0, 0), 1.0))


@kind("a hair over the touch, px wide", 1, 2, 4, on="light")
def hair(light: F4, s: int, scene: Scene) -> F4:
    shade, (x, y) = np.zeros(light.shape[1:], np.float32), on_touch(scene)
    span = light.shape[2] // 3
    cv2.ellipse(shade, (x, y + span // 2), (span, span // 2), 10, 180, 340, 1.0, s)
    return light * (1 - np.float32(0.8) * cv2.GaussianBlur(shade, (0, 0), 0.7))


def on_touch(scene: Scene) -> tuple[int, int]:
    """A pixel where the film is touched."""
    rows, columns = np.nonzero(scene.height > 0.3 * scene.height.max())
    one = int(scene.rng.integers(len(rows)))
    return int(columns[one]), int(rows[one])


@kind("a black frame around a round view, radius", 1.1, 0.9, 0.7, on="light")
def round_view(light: F4, s: float, scene: Scene) -> F4:
    x, y = across(light)
    return light * np.asarray(np.hypot(x, y) < s, np.float32)


@kind("some lines of the camera are dead, a share", 0.01, 0.05, 0.2)
def dead_lines(image: F4, s: float, scene: Scene) -> F4:
    return image * np.asarray(scene.rng.random(image.shape[1]) > s, np.float32)[:, None]


# Surfaces: touches whose zero, tilt or walls no light tells.


@kind("a wave over the whole frame, mm", 0.1, 0.3, 0.6, on="surface")
def wave(rig: Rig, s: float) -> F4:
    x, y = rig.grid()
    return np.asarray(s * (1 + np.sin(1.1 * x + 0.4 * y) * np.cos(0.9 * y)), np.float32)


@kind("an edge across the frame, mm", 0.3, 0.8, 1.5, on="surface")
def edge(rig: Rig, s: float) -> F4:
    x, y = rig.grid()
    return np.asarray(s / (1 + np.exp(-(x + 0.3 * y) / 0.6)), np.float32)


@kind("a tilted plate that reaches all borders, mm over the frame", 0.3, 1.0, 2.0, on="surface")
def tilted_plate(rig: Rig, s: float) -> F4:
    x, y = rig.grid()
    return np.asarray(s * (0.5 + 0.4 * x / np.ptp(x) + 0.3 * y / np.ptp(y)), np.float32)


@kind("vertical walls, mm high", 0.3, 1.0, 2.5, on="surface")
def walls(rig: Rig, s: float) -> F4:
    x, y = rig.grid()
    wall = s * ((np.abs(x) < 0.25 * np.ptp(x)) & (np.abs(y) < 0.25 * np.ptp(y)))
    return np.asarray(wall + shape_ball(radius_mm=1.5, **rig.canvas).height * (wall > 0), np.float32)


@kind("steps on the film, mm", 0.002, 0.01, 0.05, on="surface")
def steps(rig: Rig, s: float) -> F4:
    x, y = rig.grid()
    stairs = s * np.floor(4 * (x / np.ptp(x) + 0.5)).clip(0, 3)
    return np.asarray(stairs * (np.abs(y) < 0.3 * np.ptp(y)), np.float32)


@kind("the LEDs knocked aside by mm", 2, 6, 20, on="leds")
def leds_knocked(lights: F4, s: float) -> F4:
    return lights + np.float32([s, -s / 2, 0])


# Calibrations.


@kind("calibration: the ball's radius times s", 1.03, 1.1, 6 / 7, 2.0, on="calibration")
def radius_wrong(recipe: Recipe, s: float, rig: Rig) -> Recipe:
    return recipe._replace(radius_mm=recipe.radius_mm * s)


@kind("calibration: the pixel size times s", 1.03, 1.1, 2.0, on="calibration")
def pixel_wrong(recipe: Recipe, s: float, rig: Rig) -> Recipe:
    return recipe._replace(pixel_mm=recipe.pixel_mm * s)


@kind("calibration: radius and pixel size both times s", 2.0, on="calibration", detectable=False)
def both_wrong(recipe: Recipe, s: float, rig: Rig) -> Recipe:
    return recipe._replace(radius_mm=recipe.radius_mm * s, pixel_mm=recipe.pixel_mm * s)


@kind("calibration: two LEDs swapped in ball and flat", 0, 1, 2, on="calibration")
def order_at_calibration(recipe: Recipe, s: int, rig: Rig) -> Recipe:
    swap = np.arange(len(recipe.flat))
    swap[[s, (s + 1) % len(swap)]] = swap[[(s + 1) % len(swap), s]]
    return recipe._replace(balls=recipe.balls[:, swap], flat=recipe.flat[swap])


@kind("calibration: two LEDs swapped in the balls alone", 0, 1, 2, on="calibration")
def order_of_balls(recipe: Recipe, s: int, rig: Rig) -> Recipe:
    return order_at_calibration(recipe, s, rig)._replace(flat=recipe.flat)


@kind("calibration: the pixels off square by per cent", 3, 6, 10, on="calibration")
def not_square(recipe: Recipe, s: float, rig: Rig) -> Recipe:
    def seen(image: F4) -> F4:
        middle = (image.shape[2] - 1) / 2 * s / 100
        return warped(image, [[1 - s / 100, 0, middle], [0, 1, 0]])

    balls = np.stack([seen(ball) for ball in recipe.balls])
    return recipe._replace(balls=balls, flat=seen(recipe.flat), seen=seen)


@kind("calibration: an egg for a ball, by per cent", 2, 5, 10, on="calibration")
def egg(recipe: Recipe, s: float, rig: Rig) -> Recipe | None:
    def egg_of(ball: F4) -> F4:
        middle = (ball.shape[1] - 1) / 2 * s / 100
        return warped(ball[None], [[1 + s / 100, 0, -middle], [0, 1, 0]])[0]

    return rig.recipe_of([egg_of(ball) for ball in rig.balls()])


@kind("calibration: another object for the ball", "cone", "pyramid", "disc", on="calibration")
def another_object(recipe: Recipe, s: str, rig: Rig) -> Recipe | None:
    if rig.simulate is None:
        return None
    cone, rise = {"radius_mm": 4.0}, {"rise_mm": 1.5}
    made = {
        "cone": lambda: shape_cone(**cone, **rise, **rig.canvas),
        "pyramid": lambda: shape_pyramid(faces=4, inradius_mm=3.5, **rise, **rig.canvas),
        "disc": lambda: shape_cone(top_radius_mm=3.4, **cone, **rise, **rig.canvas),
    }
    return rig.recipe_of([made[s]().height] * len(recipe.balls))


@kind("calibration: the room's light in the ball's images", 0.02, 0.05, 0.08, on="calibration")
def ambient_at_calibration(recipe: Recipe, s: float, rig: Rig) -> Recipe:
    return recipe._replace(balls=np.clip(recipe.balls + np.float32(s), 0, 1))


@kind("calibration: gamma of its images, 1/s", 1.15, 1.5, 2.2, on="calibration")
def gamma_at_calibration(recipe: Recipe, s: float, rig: Rig) -> Recipe:
    power = np.float32(1 / s)
    return recipe._replace(balls=recipe.balls**power, flat=recipe.flat**power)


@kind("calibration: the flat frame shows a touch", 0.1, 0.3, 1.0, on="calibration")
def touch_in_flat(recipe: Recipe, s: float, rig: Rig) -> Recipe:
    touch = rig.touches[-1].light
    return recipe._replace(flat=(1 - np.float32(s)) * recipe.flat + np.float32(s) * touch)


@kind("another sensor's calibration", 1, on="pipeline")
def another_sensor(rig: Rig) -> str:
    return rig.sibling
