from tactograph.nodes import (
    DEVIATIONS_PER_MAD as DEVIATIONS_PER_MAD,
    FALSE_ALARMS as FALSE_ALARMS,
)
from tactograph.nodes.calibrate import (
    FILM_ROUGHNESS as FILM_ROUGHNESS,
    MAX_SAMPLE_SLOPE as MAX_SAMPLE_SLOPE,
    MIN_FLAT_LIGHT as MIN_FLAT_LIGHT,
)
from tactograph.nodes.calibrate.ball.balls_on_film import (
    Balls as Balls,
)
from tactograph.nodes.calibrate.film.judge_radius import (
    Alternatives as Alternatives,
)
from tactograph.nodes.calibrate.ranks.drawn import (
    Doubts as Doubts,
)
from tactograph.nodes.calibrate.rating.advise_press import (
    FILM_REGIONS as FILM_REGIONS,
)
from tactograph.nodes.calibrate.rating.judge_labels import (
    MAX_JUDGED_BALLS as MAX_JUDGED_BALLS,
)
from tactograph.nodes.calibrate.rating.pressed_ball import (
    PressedBall as PressedBall,
)
from tactograph.nodes.calibrate.rating.verdict import (
    Odds as Odds,
    pays as pays,
)
from tactograph.nodes.optics.cache_blocks import (
    in_blocks as in_blocks,
)
from tactograph.nodes.optics.gauss_newton import (
    SlopeNormal as SlopeNormal,
)
from tactograph.nodes.optics.harmonics import (
    harmonics as harmonics,
)
from tactograph.nodes.trust.check_ranks import (
    StoredRanks as StoredRanks,
)
from tactograph.nodes.trust.light_departure import (
    LightDeparture as LightDeparture,
)
