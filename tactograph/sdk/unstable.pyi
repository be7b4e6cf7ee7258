from tactograph.nodes import (
    DEVIATIONS_PER_MAD as DEVIATIONS_PER_MAD,
)
from tactograph.nodes.calibrate import (
    MIN_FLAT_LIGHT as MIN_FLAT_LIGHT,
)
<<<<<<< HEAD
from tactograph.nodes.calibrate.rating.pressed_ball import (
    PressedBall as PressedBall,
)
from tactograph.nodes.light.light_noise import (
    rest_noise as rest_noise,
)
=======
>>>>>>> rims1
from tactograph.nodes.optics.cache_blocks import (
    in_blocks as in_blocks,
)
from tactograph.nodes.trust.light_departure import (
    LightDeparture as LightDeparture,
)
