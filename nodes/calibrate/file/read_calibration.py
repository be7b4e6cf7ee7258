"""Read a calibration, and refuse an incomplete or damaged one."""

import math
from pathlib import Path

from tactograph.graph import EVERYTHING, InputError, Wanted, node
from tactograph.graph.declare.ports import make_record, record_ports
from tactograph.nodes.calibrate.file.calibration import CALIBRATION_KIND, Calibration
from tactograph.nodes.files.image_files import Lights


@node
def read_calibration(
    *,
    file: Path,
    lights: Lights | None = None,
    filled: bool = False,
    wanted: Wanted = EVERYTHING,
) -> Calibration:
    """Read the ``.npz`` that `write_calibration` wrote, without pickle.

    A warning repeats the calibration's doubts.

    Parameters
    ----------
    file : the calibration
    lights
        How the images hold the lights, as for `read_capture`.  None: unknown.
    filled
        Whether an object touches all of the film.  Then the brightness is even, but its error
        increases by the gain of touched film.

    Raises
    ------
    InputError
        If the file is missing, damaged, of another version or holds a pickle; if an array is
        missing, empty, misshapen, not finite or outside the range of any sensor; if an LED is
        not above the film, or the LEDs' light does not determine a slope; if the calibration was
        made from lights of another order; if its film at rest is not a plane, and the graph does
        not support that.
    """
    arrays, about = CALIBRATION_KIND.read_to_use(file, lights)
    header = {"quality": about.quality, "doubts": about.doubts, "serial": about.serial}
    values = {**arrays, **header}
    in_order = [values[name] for name in record_ports(Calibration)]
    record: Calibration = make_record(Calibration, in_order)
    if record.rest is None or not record.rest.any():
        record = record._replace(rest=None)
    elif "rest" not in wanted:
        raise InputError(
            f"{file}: its film is no plane at rest, which this graph does not support; use "
            "reconstruct, precise, paper or see_touch"
        )
    if filled:
        film = record.film
        film = film._replace(gain=1.0, uneven=math.hypot(film.uneven, film.gain - 1))
        record = record._replace(film=film)
    return record
