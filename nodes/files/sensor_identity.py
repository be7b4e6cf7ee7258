"""Whose calibration, recording or capture it is, and the refusal of another sensor's."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, Self

from tactograph.graph import InputError, Provenance, warn
from tactograph.graph.disk.file_identity import file_identity
from tactograph.graph.errors import one_line


class SensorIdentity(NamedTuple):
    """A sensor's name, as its user gives it, and its camera's serial number; empty if unknown."""

    name: str = ""
    serial: str = ""

    def __str__(self) -> str:
        words = {f"sensor '{self.name}'": self.name, f"serial {self.serial}": self.serial}
        return ", ".join(text for text, known in words.items() if known)

    @classmethod
    def stated_in(cls, header: Mapping[str, Any]) -> Self:
        """Return the sensor that a file names by ``sensor`` and ``serial``."""
        words = (header.get(name) for name in ("sensor", "serial"))
        return cls(*(one_line(word) if isinstance(word, str) else "" for word in words))

    @classmethod
    def behind(cls, provenance: Provenance) -> Self:
        """Return the sensor of the calibration behind a result, unless another one's was taken."""
        taken_on_purpose = provenance.arguments.get("another_sensor")
        return cls.stated_in({} if taken_on_purpose else provenance.inputs.get("calibration", {}))

    @classmethod
    def in_words(cls, calibration: Path) -> str:
        """Return when a calibration was made, and of which sensor, as far as it is known."""
        header = file_identity(calibration)
        when = f" of {header['date'][:10]}" if "date" in header else ""
        sensor = str(cls.stated_in(header)) or "a sensor without a name"
        return f"the calibration {calibration}{when} is of {sensor}"

    def check(self, place: object, calibration: Path | None, another_sensor: bool) -> None:
        """Refuse images of this sensor if the calibration is another's, as far as both are known.

        Parameters
        ----------
        place : the images, for people
        calibration : of the sensor that is expected; None: nothing is compared
        another_sensor : only warn

        Raises
        ------
        InputError
            If names or serial numbers differ.
        """
        if calibration is None:
            return
        stated = self.stated_in(file_identity(calibration))
        if all(a == b or not (a and b) for a, b in zip(self, stated, strict=True)):
            return
        line = f"{place}: is of {self}, but {self.in_words(calibration)}"
        if not another_sensor:
            raise InputError(
                f"{line}; give the calibration of this sensor, or `another_sensor`=true to take "
                "it on purpose"
            )
        warn(f"{line}; taken on purpose (`another_sensor`=true)")
