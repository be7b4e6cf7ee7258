from tactograph.nodes import (
    DEVIATIONS_PER_MAD as DEVIATIONS_PER_MAD,
    LightPlaces as LightPlaces,
)
from tactograph.nodes.calibrate import (
    MIN_BOUNCE_ERROR as MIN_BOUNCE_ERROR,
    MIN_FLAT_LIGHT as MIN_FLAT_LIGHT,
    SHIFT_DEVIATION_PX as SHIFT_DEVIATION_PX,
)
from tactograph.nodes.calibrate.ball.balls_on_film import (
    Balls as Balls,
    Fitted as Fitted,
)
from tactograph.nodes.calibrate.film.film_misfit import (
    Held as Held,
)
from tactograph.nodes.calibrate.film.film_unknowns import (
    PART_UNKNOWNS as PART_UNKNOWNS,
    Unknown as Unknown,
)
from tactograph.nodes.calibrate.lights.descend import (
    least_squares as least_squares,
)
from tactograph.nodes.calibrate.lights.light_fit import (
    LedPlaces as LedPlaces,
)
from tactograph.nodes.calibrate.lights.light_samples import (
    Rest as Rest,
)
from tactograph.nodes.calibrate.ranks.drawn import (
    LED_DRIFT as LED_DRIFT,
)
from tactograph.nodes.calibrate.rating.pressed_ball import (
    PressedBall as PressedBall,
)
from tactograph.nodes.light.light_noise import (
    rest_noise as rest_noise,
)
from tactograph.nodes.optics.cache_blocks import (
    in_blocks as in_blocks,
)
from tactograph.nodes.trust.light_departure import (
    LightDeparture as LightDeparture,
)
