"""Whose calibration, recording or capture it is, and the refusal of another sensor's."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from tactograph.graph import InputError, Provenance, warn
from tactograph.graph.disk.file_identity import file_identity
from tactograph.graph.errors import one_line


class SensorIdentity(NamedTuple):
    """A sensor's name, as its user gives it, and its camera's serial number; empty if unknown."""

    name: str = ""
    serial: str = ""

    def __str__(self) -> str:
        parts = (
            f"sensor '{self.name}'" if self.name else "",
            self.serial and f"serial {self.serial}",
        )
        return ", ".join(part for part in parts if part)


def identity_in(header: Mapping[str, Any]) -> SensorIdentity:
    """Return the sensor that a file names by ``sensor`` and ``serial``."""
    words = (header.get(name) for name in ("sensor", "serial"))
    return SensorIdentity(*(one_line(word) if isinstance(word, str) else "" for word in words))


def identity_from(provenance: Provenance) -> SensorIdentity:
    """Return the sensor of the calibration behind a result, unless another one's was taken."""
    taken_on_purpose = provenance.arguments.get("another_sensor")
    return identity_in({} if taken_on_purpose else provenance.inputs.get("calibration", {}))


class UsedCalibration(NamedTuple):
    """The calibration that a live node's frames are for.

    Parameters
    ----------
    calibration : the sensor's calibration; its flat frame shows the film at rest
    another_sensor : take the calibration of a camera of another serial number, with a warning
    """

    calibration: Path
    another_sensor: bool = False


def check_sensor(
    place: object, identity: SensorIdentity, calibration: Path | None, another_sensor: bool
) -> None:
    """Refuse images of another sensor than the calibration's, as far as both are known.

    Parameters
    ----------
    place : the images, for people
    identity : their sensor
    calibration : of the sensor that is expected; None: nothing is compared
    another_sensor : only warn

    Raises
    ------
    InputError
        If names or serial numbers differ.
    """
    if calibration is None:
        return
    header = file_identity(calibration)
    stated = identity_in(header)
    if all(a == b or not (a and b) for a, b in zip(identity, stated, strict=True)):
        return
    when = f" of {header['date'][:10]}" if "date" in header else ""
    line = f"{place}: is of {identity}, but the calibration {calibration}{when} is of {stated}"
    if not another_sensor:
        raise InputError(
            f"{line}; give the calibration of this sensor, or `another_sensor`=true to take it "
            "on purpose"
        )
    warn(f"{line}; taken on purpose (`another_sensor`=true)")
