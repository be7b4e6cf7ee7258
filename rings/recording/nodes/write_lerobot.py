"""Write touches as an episode of a LeRobot dataset, which robot policies are trained on."""

import json
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Ge

from tactograph.rings.recording.files.lerobot_rows import (
    NS_PER_S,
    Column,
    lerobot_dataset,
    open_lerobot,
    touch_columns,
)
from tactograph.rings.recording.files.stamps import TouchStamps
from tactograph.sdk import InputError, Provenance, SensorIdentity, Session, Touch, node, warn

WRITER_THREADS = 2
"""Threads that compress pictures."""
MAX_ROWS_OFF = 0.75
"""Rows between a touch and its row's time.  Above a half, or jitter would leave out touches."""


@node
def write_lerobot(
    touch: Touch,
    *,
    folder: Path,
    sensor: str = "touch",
    task: str = "touch",
    rate: Annotated[int, Ge(1)] = 30,
    figures: str = "x_mm,y_mm,depth_mm,area_mm2,volume_mm3",
    contacts: Annotated[int, Ge(0)] = 4,
    provenance: Provenance,
    session: Session,
) -> None:
    """Write the touches of a stream as one episode of a LeRobot dataset.

    The columns of a row: ``observation.images.SENSOR_height``, the height's 16-bit levels (red:
    high byte, green: low byte; step and offset in ``meta/info.json``);
    ``observation.images.SENSOR_lights1`` …, the images of three LEDs as the channels of one
    picture of 8 bits; ``observation.SENSOR.contacts``; ``observation.SENSOR.NAME`` of each layer
    that is a state, such as ``pose``; ``SENSOR.time``, the exposure's time since 1970 in seconds
    and nanoseconds.
    ``meta/info.json`` also says whose sensor it is, and by which calibration.

    LeRobot's own ``timestamp`` is even: row i is at i / rate.  Every touch is the next row, as
    long as that is less than a row from its time.  Where touches are missing, the row before is
    repeated, as a camera that stood still would; touches that come faster than rows are left
    out, with a warning at the end.  Touches without a time, such as captures, are a row each.

    Parameters
    ----------
    touch : as `join_touch` makes it
    folder : created; a dataset that is there already gets one more episode
    sensor : the sensor's name in the dataset: ``left``, say
    task : what is done, in words; policies read it
    rate : rows per second: that of the dataset's other cameras
    figures
        The figures of `measure_contact` and others that are kept of each contact, separated by
        commas, such as ``force_n``; without ``contact_``.
    contacts : number of contacts of which figures are kept; 0: none

    Raises
    ------
    InputError
        If ``lerobot`` is not installed, the folder holds something else or touches of another
        kind, a height does not fit into 16 bits, or a figure is not measured.
    """
    stamps = session.keep(lambda: _Episode(folder, task, rate))
    names = [name.strip() for name in figures.split(",") if name.strip()]
    identity = {
        **SensorIdentity.behind(provenance)._asdict(),
        **provenance.inputs.get("calibration", {}),
    }
    origin = {"sensor": identity.pop("name"), **identity}
    stamp = stamps.clock.of(touch.time)
    columns = touch_columns(touch, stamp, sensor, names, contacts, origin)
    stamps.put(columns, None if touch.time is None else stamp)


class _Episode:
    """The rows of one stream; the dataset is opened at the first."""

    def __init__(self, folder: Path, task: str, rate: int) -> None:
        self._folder, self._task, self._rate = folder, task, rate
        self.clock = TouchStamps()
        self._dataset: Any = None
        self._before: dict[str, Any] = {}
        self._rows = self._skipped = self._began = 0

    def put(self, columns: dict[str, Column], stamp: int | None) -> None:
        """Put a touch into its row; `stamp` is its time in ns, None: the next row."""
        if self._dataset is None:
            self._dataset = self._opened(columns)
            self._began = stamp or 0
        place = self._rows if stamp is None else (stamp - self._began) * self._rate / NS_PER_S
        if place < self._rows - MAX_ROWS_OFF:
            self._skipped += 1
            return
        while place > self._rows + MAX_ROWS_OFF:
            self._add(self._before)
        self._before = {name: column.value for name, column in columns.items()}
        self._add(self._before)

    def _add(self, row: dict[str, Any]) -> None:
        # LeRobot empties the mapping that it is given.
        self._dataset.add_frame({**row, "task": self._task})
        self._rows += 1

    def _opened(self, columns: dict[str, Column]) -> Any:
        features = {name: column.feature for name, column in columns.items()}
        if not self._folder.exists():
            name = f"local/{self._folder.resolve().name}"
            dataset = lerobot_dataset().create(
                name, self._rate, features, self._folder, "tactograph", use_videos=False
            )
        else:
            dataset = open_lerobot(self._folder)
            self._check(dataset, features)
        dataset.start_image_writer(num_threads=WRITER_THREADS)
        return dataset

    def _check(self, dataset: Any, features: dict[str, Any]) -> None:
        """Refuse a dataset whose rows are of another kind."""
        has = {name: dataset.features.get(name) for name in features}
        rows = {*dataset.features} - {*features}
        as_text = partial(json.dumps, sort_keys=True)
        unlike = sorted(n for n in features if as_text(has[n]) != as_text(features[n]))
        unlike += sorted(name for name in rows if "." in name)
        if unlike:
            raise InputError(
                f"{self._folder}: its episodes differ in {', '.join(unlike)}: another sensor, "
                "calibration or graph; write into another folder"
            )
        if dataset.fps != self._rate:
            raise InputError(f"{self._folder}: has {dataset.fps} rows per second, not {self._rate}")

    def close(self) -> None:
        """Save the episode."""
        if self._dataset is None:
            return
        self._dataset.save_episode()
        self._dataset.stop_image_writer()
        self._dataset.finalize()
        if self._skipped:
            warn(
                f"{self._folder}: {self._skipped} touches came faster than {self._rate} rows per "
                "second and are left out; raise rate"
            )
