"""Films that are not matt, each by one of its properties, and samples of balls under them."""

import numpy as np

from tactograph.nodes import F4, Film

LEDS = np.array([[21, 21, 37], [-21, 22, 36], [-22, -20, 38], [20, -21, 36]], np.float32)
"""Places of four LEDs in mm, none like another."""


def harmonics(strength: float = 0.02, seed: int = 5) -> F4:
    """Coefficients of all harmonics, constant and linear in the place."""
    coefficients = np.zeros((len(LEDS), 8, 6), np.float32)
    rng = np.random.default_rng(seed)
    coefficients[..., :3] = rng.uniform(-strength, strength, coefficients[..., :3].shape)
    return coefficients


MATT = Film.matt(LEDS)
FILMS: dict[str, Film] = {
    "diffuse": MATT._replace(diffuse=np.array([0.3, 0.25, 0.35, 0.3], np.float32), gain=1.05),
    "soft": MATT._replace(diffuse=np.full(4, 0.4, np.float32), wrap=0.2),
    "lobe": MATT._replace(base=0.6, roughness=0.3, refraction=1.4),
    "camera": MATT._replace(camera=1 / 65),
    "disks": MATT._replace(emission=1.0),
    "board": MATT._replace(emission=1.0, aim=1.0),
    "harmonics": MATT._replace(harmonics=harmonics(), flattest=0.5, reach=10.0),
}
FILMS["all"] = FILMS["diffuse"]._replace(
    wrap=0.2, base=0.6, roughness=0.3, refraction=1.4, camera=1 / 65, emission=1.0, aim=0.4,
    harmonics=harmonics(), flattest=0.5, reach=10.0,
)  # fmt: skip


def normals(slope: F4) -> F4:
    """Unit normals of slopes 2 x ..."""
    p, q = slope
    return np.stack([-p, -q, np.ones_like(p)]) / np.sqrt(1 + p * p + q * q)


def ball_seen(
    radius: float, rim: float, centre: tuple[float, float], camera: float, size: tuple[int, int]
) -> tuple[F4, F4, F4]:
    """The view of a ball in the film by a camera, in an image 20 mm across.

    Returns the apparent height Z = z / (1 - z / D), the film's slopes, 0 outside the ball,
    and 1 where the ball is.
    """
    rows, columns = size
    pixel = 20 / columns
    y, x = (
        np.mgrid[:rows, :columns] - np.array([(rows - 1) / 2, (columns - 1) / 2])[:, None, None]
    ) * pixel
    cz = -np.sqrt(radius**2 - rim**2)
    z = np.zeros(size)
    for _ in range(60):
        nearer = 1 - camera * z
        away = (x * nearer - centre[0]) ** 2 + (y * nearer - centre[1]) ** 2
        z = np.maximum(np.sqrt(np.maximum(radius**2 - away, 0)) + cz, 0)
    on = z > 0
    nearer = 1 - camera * z
    up = np.where(on, z - cz, 1)
    slope = np.where(on, -np.stack([x * nearer - centre[0], y * nearer - centre[1]]) / up, 0)
    apparent = z / nearer
    return apparent.astype(np.float32), slope.astype(np.float32), on
