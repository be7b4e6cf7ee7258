"""LEDs and film of a sensor into which no ball was pressed."""

from typing import Annotated

from tactograph.sdk import F4, Port

LightPlaces = Annotated[F4, Port("8 K 3", "mm")]
"""Eight sets of places that the lights may have as well."""
