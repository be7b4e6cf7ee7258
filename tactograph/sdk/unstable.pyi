from tactograph.graph.commands.progress_line import (
    ProgressLine as ProgressLine,
)
from tactograph.graph.cores import (
    CORES_VARIABLE as CORES_VARIABLE,
)
from tactograph.graph.disk.folder_lock import (
    lock_folder as lock_folder,
)
from tactograph.graph.disk.text_names import (
    refuse_other_names as refuse_other_names,
)
from tactograph.graph.files.captures_in import (
    captures_in as captures_in,
)
from tactograph.graph.files.graph_places import (
    find_file as find_file,
)
from tactograph.graph.files.read_graph import (
    graphs_of as graphs_of,
    shipped_names as shipped_names,
)
from tactograph.graph.run.open_pipeline import (
    refuse_to_write_over as refuse_to_write_over,
)
from tactograph.nodes import (
    DEVIATIONS_PER_MAD as DEVIATIONS_PER_MAD,
    LightPlaces as LightPlaces,
    Tables as Tables,
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
from tactograph.nodes.calibrate.file.camera_lens import (
    CAMERA_KIND as CAMERA_KIND,
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
from tactograph.nodes.calibrate.tables.build_lut import (
    TablePixels as TablePixels,
)
from tactograph.nodes.capture.read_balls import (
    BallPresses as BallPresses,
)
from tactograph.nodes.drawing.new_picture import (
    list_figures as list_figures,
)
from tactograph.nodes.files.image_files import (
    Channel as Channel,
)
from tactograph.nodes.files.sensor_preset import (
    SensorPreset as SensorPreset,
)
from tactograph.nodes.light.film_drift import (
    terms as terms,
)
from tactograph.nodes.optics.cache_blocks import (
    in_blocks as in_blocks,
)
from tactograph.nodes.optics.near_light import (
    matt_film_light as matt_film_light,
)
from tactograph.nodes.trust.light_departure import (
    LightDeparture as LightDeparture,
)
