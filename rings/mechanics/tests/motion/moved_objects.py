"""Objects pressed against the film, moved, and seen with the noise of integrated slopes."""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from tactograph.nodes import F4, F8, U1
from tactograph.nodes.height.integrate_dct import integrate_dct

SHAPE, PIXEL = (120, 160), 0.1
SIGMA = 0.02
"""Standard deviation of a slope."""
STATED = np.full((2, *SHAPE), SIGMA**2, np.float32)
PRESSED = 0.05
"""Height in mm above which film is touched."""
Shape = Callable[[F8, F8], F8]
"""The object's height in mm at x and y in mm."""


def texture(x: F8, y: F8) -> F8:
    """Forty waves of 1.5 to 6 mm in all directions."""
    rng, total = np.random.default_rng(7), np.zeros_like(x)
    for length in np.linspace(1.5, 6, 40):
        angle, phase = rng.uniform(0, 2 * np.pi, 2)
        total += np.cos(2 * np.pi / length * (x * np.cos(angle) + y * np.sin(angle)) + phase)
    return 0.015 * total


def coin(x: F8, y: F8) -> F8:
    """A textured dome, all of which is in view."""
    return 0.4 - (x**2 + y**2) / 40 + texture(x, y)


def plate(x: F8, y: F8) -> F8:
    """Textured, and larger than the film."""
    return 0.4 + texture(x, y)


def ball(x: F8, y: F8) -> F8:
    return 0.9 - 4 + np.sqrt(np.maximum(16 - x * x - y * y, 0.01))


def cylinder(x: F8, y: F8) -> F8:
    """Along x, beyond the frame."""
    return 0.9 - 4 + np.sqrt(np.maximum(16 - y * y, 0.01))


def moved(x: float, y: float, z: float, *turn_deg: float) -> F8:
    """The 4 x 4 matrix of a shift in mm and a turn in degrees."""
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(turn_deg, degrees=True).as_matrix()
    motion[:3, 3] = x, y, z
    return motion


def shift_and_turn(motion: F8) -> F8:
    """The six numbers of `moved`."""
    turn = Rotation.from_matrix(motion[:3, :3]).as_rotvec(degrees=True)
    return np.concatenate([motion[:3, 3], turn])


def pressed(shape: Shape, motion: F8) -> F8:
    """The object's height above the film, moved by a 4 x 4 matrix."""
    y, x = (PIXEL * (i - (n - 1) / 2) for i, n in zip(np.indices(SHAPE), SHAPE, strict=True))
    return height_at(shape, motion, x, y)


def height_at(shape: Shape, motion: F8, x: F8, y: F8) -> F8:
    """The moved object's height at places in mm."""
    back, z = np.linalg.inv(motion), np.zeros_like(x)
    for _ in range(10):
        u, v, w = (back[i, 0] * x + back[i, 1] * y + back[i, 2] * z + back[i, 3] for i in range(3))
        z = z + (shape(u, v) - w) * motion[2, 2]
    return z


def seen(z: F8, rng: np.random.Generator) -> tuple[F4, U1]:
    """Height of the film with noise, and where it is touched."""
    contact = (z > PRESSED).astype(np.uint8)
    noise = integrate_dct(rng.normal(0, SIGMA, (2, *z.shape)).astype(np.float32), PIXEL)
    rest = noise[contact == 0]
    noise -= rest.mean() if rest.size else 0
    return (np.maximum(z, 0) + noise).astype(np.float32), contact
