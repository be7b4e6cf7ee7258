"""Compare the film with that of the calibration, and carry a calibration over to another film."""

from typing import Annotated

from tactograph.sdk import F4, Port

TiltResponse = Annotated[F4, Port("K 2 H W", "1", low=-2, high=2)]
"""Relative change of each LED's light on the film at rest, per slope p and q."""
MAX_INDEPENDENT = 200
"""Most independent values per LED that a check press counts as, since departures are smooth."""
