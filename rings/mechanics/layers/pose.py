"""The motion of the touched object since the touch began."""

from typing import Annotated, NamedTuple

import numpy as np

from tactograph.sdk import F4, Axes, LayerKind, Port, Touch

Pose = Annotated[F4, Port("6", "mm, deg")]
"""Shift x, y, z and turn vector x, y, z of the object, about the image's middle on the film at
rest.  A turn about z is positive from x to y."""


PoseCovariance = Annotated[F4, Port("6 6", "mm, deg")]
"""Covariance of the pose's six numbers; turns about the film's axes."""
POSE_NAMES = ("x_mm", "y_mm", "z_mm", "turn_x_deg", "turn_y_deg", "turn_z_deg")


class ObjectPose(NamedTuple):
    """The motion of the touched object since the touch began."""

    pose: Pose
    covariance: PoseCovariance


def _axes(touch: Touch, moved: ObjectPose) -> Axes:
    rows, columns = touch.height.shape
    middle = touch.pixel * np.array([columns - 1, rows - 1, 0]) / 2
    return Axes("object", moved.pose[:3] + middle, moved.pose[3:], moved.covariance)


def _state(moved: ObjectPose) -> dict[str, float]:
    return dict(zip(POSE_NAMES, moved.pose.tolist(), strict=True))


KIND = LayerKind(ObjectPose, _axes, topics={"pose": _axes}, state=_state)
