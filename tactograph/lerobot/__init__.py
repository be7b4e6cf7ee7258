"""A camera for LeRobot: ``lerobot-record --robot.discover_packages_path=tactograph.lerobot``.

LeRobot imports this package and finds the camera's type, ``tactograph``.
"""

from tactograph.lerobot.camera import TactographCamera, TactographCameraConfig

__all__ = ["TactographCamera", "TactographCameraConfig"]
