"""A camera for LeRobot: ``--robot.discover_packages_path=tactograph.rings.recording.lerobot``.

LeRobot imports this package and finds the camera's type, ``tactograph``.
"""

from tactograph.rings.recording.lerobot.camera import TactographCamera, TactographCameraConfig

__all__ = ["TactographCamera", "TactographCameraConfig"]
