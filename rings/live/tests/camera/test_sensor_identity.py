"""A camera is not used with the calibration of another sensor."""

import pytest

from tactograph.graph import InputError
from tactograph.rings.live.nodes.camera.camera_params import CameraParams, UsedCalibration
from tests.nodes.files.test_sensor_identity import Calibrated, calibrated

__all__ = ["calibrated"]


def test_a_camera_is_not_used_with_the_calibration_of_another(calibrated: Calibrated) -> None:
    mini = UsedCalibration(calibrated("mini", "A1"))
    CameraParams("serial:A1").check_calibration(mini)
    CameraParams("simulated").check_calibration(mini)
    with pytest.raises(InputError, match=r"`camera`=serial:B2: is of serial B2, but .* serial A1"):
        CameraParams("serial:B2").check_calibration(mini)
