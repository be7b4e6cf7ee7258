"""The film at rest where it is no plane: from a height map, a mesh or a form.

Long because each of the three is read and checked in a way of its own.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Len
from numpy.typing import NDArray

from tactograph.rings.shapes.mesh_file import rasterised, read_mesh
from tactograph.sdk import (
    F4,
    F8,
    FilmEvidence,
    HeightFile,
    InputError,
    Lens,
    Light,
    Mask,
    PixelSize,
    RestShape,
    image_places,
    node,
    warn,
)
from tactograph.sdk.nodes import undistort

MESH_SUFFIXES = (".stl", ".ply", ".obj", ".off", ".glb")
SEARCH_NAME = "find"
"""What stands in place of a file where the shape is to be found."""
MAX_MISSING_SHARE = 0.5
"""Share of the frame without film of a shape from which on the shape is another's."""
RAY_STEPS = 40
"""Steps that follow a camera's ray to the film: the steeper both are, the more it takes."""
Pose = Annotated[tuple[float, ...], Len(2, 4)]
"""x, y in mm, then z in mm, then a turn in degrees from x to y."""
Radius = float | Annotated[tuple[float, ...], Len(1, 2)]


class Resting(NamedTuple):
    """The shape of the film at rest; None if it is to be found.

    `visible` is 1 where a pixel sees the film, 0 where its own curvature or its end hides it; None:
    everywhere.
    """

    shape: RestShape | None
    visible: Mask | None


@node
def read_rest(
    image: Light,
    pixel: PixelSize,
    lens: Lens,
    *,
    file: Path | None = None,
    radius_mm: float | None = None,
    cylinder_mm: Radius | None = None,
    at_mm: Pose | None = None,
    camera_mm: Annotated[float, Ge(1 / FilmEvidence.prior("camera").high)] | None = None,
) -> Resting:
    """Return the film at rest, as its maker's drawing has it.

    Parameters
    ----------
    image : K x H x W, whose size and pixels it gets
    pixel : mm per px at height 0
    lens : length 8; a height map is on the camera's own grid
    file
        ``find``: `find_rest` is to find it.  Else the height in mm that each pixel sees, H x W
        (.npy, .tif and other height maps); or a mesh (.stl, .ply, .obj) in mm from the image's
        middle: x right, y up, z to the camera, its surface that which the camera sees.
    radius_mm
        Radius of a ball that the film is part of.  Above 0 the film rises to its border, as a
        fingertip does that is seen from within; below 0 it rises to its middle.
    cylinder_mm : the same of a cylinder; a second number turns its axis from x to y, in degrees
    at_mm
        Where a form's lowest point (or highest, below 0), or a mesh's origin, lies: x right, y
        down, z; for a mesh also a turn from x to y in degrees.
    camera_mm : height of the pupil above height 0

    Raises
    ------
    InputError
        If none or more than one is given, the file cannot be read or is of another size, the film
        does not fill half of the frame, or it is steeper than 45 degrees all over it.
    """
    params = {"`file`": file, "`radius_mm`": radius_mm, "`cylinder_mm`": cylinder_mm}
    names = [name for name, value in params.items() if value is not None]
    if len(names) == 1 and file and file.name == SEARCH_NAME and not file.is_file():
        return Resting(None, None)
    if len(names) > 1:
        raise InputError(f"{names[0]} and {names[1]}: the film has one shape at rest; give one")
    if not names:
        raise InputError(
            f"{', '.join(params)}: a film that is no plane needs one of them; `file`=find looks "
            "for its shape"
        )
    camera = 0.0 if camera_mm is None else 1 / camera_mm
    x, y, z, turn = (*(at_mm or ()), 0.0, 0.0, 0.0, 0.0)[:4]
    size = image.shape[1], image.shape[2]
    if file is None:
        height = by_rays(size, pixel, camera, _form(radius_mm, cylinder_mm, (x, y, z)))
    elif file.suffix.lower() in MESH_SUFFIXES:
        height = _by_mesh(file, size, pixel, camera, (x, y, z, turn)).astype(np.float64)
    else:
        stored = HeightFile.read(file).height
        if stored.shape != size:
            raise InputError(
                f"{file}: is {stored.shape[1]} x {stored.shape[0]} pixels, but the images are "
                f"{size[1]} x {size[0]}: give the height that each pixel sees"
            )
        even = undistort(np.asarray(stored, np.float32)[None], lens)[0]
        height = (even + np.float32(z)).astype(np.float64)
    is_known = np.isfinite(height)
    if not is_known.all():
        height = _continued(height, is_known, file or names[0])
    if camera * float(height.max()) >= 1:
        raise InputError(
            f"{file or names[0]}: the film rises to the pupil at {camera_mm:g} mm; "
            "check `camera_mm`"
        )
    rise, frame = float(np.ptp(height)), pixel * float(np.hypot(*size))
    if rise > frame:
        raise InputError(
            f"{file or names[0]}: the film at rest rises by {rise:.4g} mm within a frame of "
            f"{frame:.3g} mm, too steep to be seen: is it in mm?"
        )
    shape = RestShape.of(np.asarray(height, np.float32), pixel, camera)
    visible = None if is_known.all() else is_known.astype(np.uint8)
    return Resting(shape, visible)


def _continued(height: F8, is_known: NDArray[np.bool_], source: Path | str) -> F8:
    """The height with that of the nearest film where a pixel sees none."""
    missing = float(1 - is_known.mean())
    if missing >= MAX_MISSING_SHARE:
        raise InputError(
            f"{source}: {missing:.1%} of the frame sees no film of this shape: check its "
            "radius or unit, and where it lies (`at_mm`)"
        )
    warn(
        f"{source}: {missing:.1%} of the frame sees no film of this shape, and is left out as "
        "unknown"
    )
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(~is_known, return_distances=False, return_indices=True)
    return np.asarray(height[tuple(nearest)])


def _form(
    radius_mm: float | None, cylinder_mm: Radius | None, at: tuple[float, float, float]
) -> Callable[[F8, F8], F8]:
    """The height of a ball or a cylinder over places in mm from its middle; NaN beside it."""
    values = (radius_mm,) if cylinder_mm is None else np.ravel(cylinder_mm).tolist()
    radius, angle = float(values[0] or 0), np.radians(values[1] if len(values) > 1 else 0.0)
    if radius == 0:
        raise InputError("`radius_mm`, `cylinder_mm`: a radius is not 0; leave out a plane's")
    along = 0.0 if cylinder_mm is None else 1.0

    def height(x: F8, y: F8) -> F8:
        x, y = x - at[0], y - at[1]
        square = x * x + y * y - along * (x * np.cos(angle) + y * np.sin(angle)) ** 2
        inside = np.where(square < radius * radius, radius * radius - square, np.nan)
        return np.asarray(np.sign(radius) * (abs(radius) - np.sqrt(inside)) + at[2])

    return height


def by_rays(size: tuple[int, int], pixel: float, camera: float, form: Callable[[F8, F8], F8]) -> F8:
    """Return the height at which the ray of each pixel meets a form, by its height over x and y."""
    u, v = (part.astype(np.float64) for part in image_places(size, pixel))
    height = np.zeros(size)
    for _ in range(RAY_STEPS if camera else 1):
        nearer = 1 - camera * height
        height = form(u * nearer, v * nearer)
    return height


def _by_mesh(
    file: Path,
    size: tuple[int, int],
    pixel: float,
    camera: float,
    at: tuple[float, float, float, float],
) -> F4:
    """The height at which each ray meets a mesh; a pinhole sees planes as planes (V1)."""
    vertices, triangles = read_mesh(file, "read_rest")
    x, y, z = vertices.T * np.array([[1], [-1], [1]])
    c, s = np.cos(np.radians(at[3])), np.sin(np.radians(at[3]))
    x, y, z = c * x - s * y + at[0], s * x + c * y + at[1], z + at[2]
    if camera and camera * z.max() >= 1:
        raise InputError(f"{file}: the mesh rises to the pupil; check `camera_mm` and `at_mm`")
    x, y, z = (part / (1 - camera * z) for part in (x, y, z))
    rows, columns = size
    # Zero is where no triangle is, so all lie above it.
    low = float(z.min()) - 1
    corners = np.stack([x / pixel + (columns - 1) / 2, y / pixel + (rows - 1) / 2, z - low], axis=1)
    depth = rasterised(corners[triangles], rows, columns)
    depth = np.where(depth > 0, depth + low, np.nan)
    return np.asarray(depth / (1 + camera * depth), np.float32)
