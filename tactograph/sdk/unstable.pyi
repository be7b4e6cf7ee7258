from tactograph.nodes import (
    DEVIATIONS_PER_MAD as DEVIATIONS_PER_MAD,
)
from tactograph.nodes.calibrate import (
    MIN_FLAT_LIGHT as MIN_FLAT_LIGHT,
)
from tactograph.nodes.optics.cache_blocks import (
    in_blocks as in_blocks,
)
from tactograph.nodes.trust.light_departure import (
    LightDeparture as LightDeparture,
)
