"""The camera's view of a film: the places that its pixels see, and a regular grid of them.

A camera whose pupil is D above the film sees the point (u, v) (1 - z / D) at height z in the same
pixel as the place (u, v) of the film at rest.  Its lens moves that place in the image
(`optics.lens`).  Places are in pixels of the ideal image, from the image's middle.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError
from tactograph.nodes import F4, I4, Height, Lens, Vergence
from tactograph.nodes.optics.bicubic import between_pixels
from tactograph.nodes.optics.lens import (
    LENS_TERMS,
    camera_offset,
    half_diagonal,
    ideal_offset,
    ideal_places,
    is_straight,
)

BISECTION_STEPS = 10
"""Bisections in the search for the pixel that sees a point of the grid."""
MESH_AXES = "mm from the image's middle on the film at rest; x right, y up, z to the camera"
"""Comment in meshes; an STL has room for 80 bytes."""

Places = NDArray[Any]


class Mesh(NamedTuple):
    """A triangle mesh: V x 3 in mm, and F x 3, the vertices' numbers.

    Meshes are right-handed: x right, y up (so the image's rows run towards -y), z to the
    camera.  The origin is the image's middle on the film at rest.
    """

    vertices: F4
    faces: I4
    axes: str = MESH_AXES


class View(NamedTuple):
    """The lens (length 8; None: no distortion) and 1 / D in 1/mm (0 or None: far away)."""

    lens: Lens | None = None
    camera: Vergence | None = None

    @staticmethod
    def lens_of(terms: Mapping[str, float]) -> Places:
        """Return the lens of these `LENS_TERMS`; missing terms are 0."""
        return np.array([terms.get(name, 0.0) for name in LENS_TERMS])

    @staticmethod
    def unit(shape: tuple[int, ...]) -> float:
        """Return the unit of a lens's places in px: half of the image's diagonal."""
        return float(half_diagonal(shape))

    def offset(self, u: Places, v: Places) -> tuple[Places, Places]:
        """Return the offset at which the camera sees ideal places; all in `unit`s."""
        none = np.zeros_like(u), np.zeros_like(v)
        return none if self.lens is None else camera_offset(self.lens, u, v)

    @property
    def is_plain(self) -> bool:
        """Whether pixels see an even grid on the film at any height."""
        return (self.lens is None or is_straight(self.lens)) and not self.camera

    def stated(self) -> dict[str, object]:
        """Return the entries that a file keeps of this view, for `stated_in`; none if plain."""
        if self.is_plain:
            return {}
        terms = [0.0] * len(LENS_TERMS) if self.lens is None else self.lens.tolist()
        return {"lens": terms, "camera": float(self.camera or 0.0)}

    @classmethod
    def stated_in(cls, header: Mapping[str, Any], file: Path) -> Self:
        """Return the view that a file states; a plain one if it states none.

        Raises
        ------
        InputError
            If the entries are no view.
        """
        if "lens" not in header:
            return cls()
        try:
            lens, camera = np.array(header["lens"], np.float32), float(header["camera"])
        except (KeyError, TypeError, ValueError):
            lens, camera = np.array([np.nan]), 0.0
        if lens.shape != (len(LENS_TERMS),) or not np.isfinite([*lens, camera]).all():
            raise InputError(f"{file}: the camera's view is damaged; reconstruct again")
        return cls(lens, camera)

    def pixel_sides(self, pixel: float) -> tuple[float, float]:
        """Return the sides along x and y of the camera's pixels, from the ideal image's `pixel`."""
        a = 0.0 if self.lens is None else float(self.lens[LENS_TERMS.index("a")])
        return pixel / (1 + a), pixel / (1 - a)

    def ideal(self, shape: tuple[int, int], x: Any, y: Any) -> tuple[Places, Places]:
        """Return the places on the ideal grid that pixels at columns x and rows y see."""
        rows, columns = shape
        half = self.unit(shape)
        u, v = (x - (columns - 1) / 2) / half, (y - (rows - 1) / 2) / half
        if self.lens is None:
            return half * u, half * v
        du, dv = ideal_offset(self.lens.astype(np.float64), u, v)
        return half * (u + du), half * (v + dv)

    def ideal_circles(self, shape: tuple[int, int], circles: F4) -> F4:
        """Return circles, P x 3 in px, with their centres moved to the ideal image."""
        moved, middle = circles.copy(), (np.array(shape[::-1]) - 1) / 2
        moved[:, :2] = np.stack(self.ideal(shape, *circles[:, :2].T), axis=1) + middle
        return moved

    def ideal_steps(self, shape: tuple[int, int], x: float, y: float) -> Places:
        """Return the change of `ideal` by one pixel along x and along y, 2 x 2."""
        steps = np.array([[0.5, -0.5, 0, 0], [0, 0, 0.5, -0.5]])
        right, left, below, above = np.array(self.ideal(shape, x + steps[0], y + steps[1])).T
        return np.stack([right - left, below - above], axis=1)

    def mesh(self, height: Height, pixel: float) -> Mesh:
        """Return a height map as a mesh, two triangles between four pixels.

        Points lie at their `places` on the film.  Unknown heights (NaN) are left out.
        """
        rows, columns = height.shape
        x, y = self.places(height)
        vertices = np.stack([x * pixel, -y * pixel, height], axis=-1).reshape(-1, 3)
        corner = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)[:-1, :-1].ravel()
        right, below = corner + 1, corner + columns
        halves = [np.stack([corner, below, right], 1), np.stack([right, below, below + 1], 1)]
        faces, is_known = np.concatenate(halves), np.isfinite(vertices[:, 2])
        if not is_known.all():
            number = np.cumsum(is_known) - 1
            vertices, faces = vertices[is_known], number[faces[is_known[faces].all(axis=1)]]
        return Mesh(vertices.astype(np.float32), faces.astype(np.int32))

    def places(self, height: Height, step: int = 1) -> tuple[Places, Places]:
        """Return x and y in px of the points of a film that pixels see.

        Parameters
        ----------
        height : H x W in mm, as seen
        step : spacing in px of the rows and columns

        Raises
        ------
        InputError
            If the film rises to the camera.
        """
        lens, camera = self.lens, self.camera or 0.0
        _check_below(height, camera)
        rows, columns = height.shape
        if lens is None or is_straight(lens):
            row, column = np.mgrid[:rows:step, :columns:step].astype(np.float64)
        else:
            column, row = (p.astype(np.float64) for p in ideal_places(lens, height.shape, step))
        nearer = 1 - height[::step, ::step].astype(np.float64) * camera
        middle = (columns - 1) / 2, (rows - 1) / 2
        return (column - middle[0]) * nearer, (row - middle[1]) * nearer

    def on_even_grid(self, height: Height, others: list[F4]) -> tuple[Height, list[F4]]:
        """Return the height, and other maps, on an even grid on the film.

        For each point of the grid, a search along the line to the image's middle finds the pixel
        that sees the film above it.  Points that no pixel sees, at the border, are NaN.

        Parameters
        ----------
        height : H x W in mm, as seen
        others : H x W each, interpolated linearly

        Raises
        ------
        InputError
            If the film rises to the camera.
        """
        camera = self.camera or 0.0
        _check_below(height, camera)
        if self.is_plain:
            return height, others
        exact = self if self.lens is None else View(self.lens.astype(np.float64))
        rows, columns = height.shape
        half = self.unit(height.shape)
        row, column = np.mgrid[:rows, :columns].astype(np.float64)
        u, v = (column - (columns - 1) / 2) / half, (row - (rows - 1) / 2) / half

        def places(stretch: Places) -> tuple[Places, Places]:
            du, dv = exact.offset(u * stretch, v * stretch)
            x, y = (u * stretch + du) * half, (v * stretch + dv) * half
            return x + (columns - 1) / 2, y + (rows - 1) / 2

        low = np.full(u.shape, 1 / (1 - camera * min(float(height.min()), 0.0)))
        high = np.full(u.shape, 1 / (1 - camera * max(float(height.max()), 0.0)))
        for _ in range(BISECTION_STEPS if camera else 0):
            middle = (low + high) / 2
            is_beyond = middle * (1 - camera * _linear(height, *places(middle))) - 1 > 0
            low, high = np.where(is_beyond, low, middle), np.where(is_beyond, middle, high)
        x, y = places((low + high) / 2)
        inside = (x >= 0) & (x <= columns - 1) & (y >= 0) & (y <= rows - 1)
        heights = between_pixels(height, x.astype(np.float32), y.astype(np.float32))
        nowhere = np.float32(np.nan)
        maps = [np.float32(_linear(other, x, y)) for other in others]
        return np.where(inside, heights, nowhere), [np.where(inside, m, nowhere) for m in maps]


def _linear(plane: F4, x: Places, y: Places) -> Places:
    from scipy.ndimage import map_coordinates  # takes 0.3 s; not needed without lens and camera

    return np.asarray(map_coordinates(plane, (y, x), order=1, mode="nearest"))


def _check_below(height: Height, camera: float) -> None:
    highest = float(height.max())
    if camera * highest >= 1:
        raise InputError(
            f"the film rises to {highest:.3g} mm, but the camera's pupil is {1 / camera:.3g} mm "
            "above it; check its height in the calibration"
        )
