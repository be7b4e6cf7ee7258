from tactograph.graph import (
    Cache as Cache,
    Close as Close,
    EndOfStream as EndOfStream,
    InputError as InputError,
    KeepIntegers as KeepIntegers,
    NodeCall as NodeCall,
    Pipeline as Pipeline,
    Port as Port,
    Provenance as Provenance,
    Session as Session,
    SizeLimit as SizeLimit,
    SizeRule as SizeRule,
    TactographError as TactographError,
    load as load,
    node as node,
    parity as parity,
    warn as warn,
)
from tactograph.graph.backends.launch import (
    Launch as Launch,
)
from tactograph.graph.commands import (
    RunOptions as RunOptions,
    graph_command as graph_command,
)
from tactograph.graph.cores import (
    cores as cores,
)
from tactograph.graph.declare.node_page import (
    node_page as node_page,
)
from tactograph.graph.disk.atomic_files import (
    atomic_files as atomic_files,
)
from tactograph.graph.disk.strict_yaml import (
    Document as Document,
)
from tactograph.graph.errors import (
    one_line as one_line,
)
from tactograph.graph.extras import (
    need as need,
)
from tactograph.graph.files.flat_graph import (
    Graph as Graph,
)
from tactograph.graph.files.read_graph import (
    GraphFile as GraphFile,
    read_graph as read_graph,
)
from tactograph.graph.rings import (
    brought as brought,
)
from tactograph.graph.run.progress import (
    tell_progress as tell_progress,
)
from tactograph.graph.run.result import (
    Result as Result,
)
from tactograph.nodes import (
    F4 as F4,
    F8 as F8,
    Contacts as Contacts,
    Dark as Dark,
    Film as Film,
    Height as Height,
    HeightError as HeightError,
    Labels as Labels,
    Lens as Lens,
    Light as Light,
    LightPositions as LightPositions,
    Mask as Mask,
    Misfit as Misfit,
    Noise as Noise,
    PixelSize as PixelSize,
    ScaleError as ScaleError,
    Slope as Slope,
    robust_deviation as robust_deviation,
)
from tactograph.nodes.calibrate.ball.find_balls import (
    FoundBalls as FoundBalls,
)
from tactograph.nodes.calibrate.film.ball_samples import (
    FilmEvidence as FilmEvidence,
)
from tactograph.nodes.calibrate.film.shape_fit import (
    ShapeFit as ShapeFit,
)
from tactograph.nodes.calibrate.rating.pressed_ball import (
    PressedBall as PressedBall,
)
from tactograph.nodes.calibrate.rating.verdict import (
    Judged as Judged,
    Odds as Odds,
)
from tactograph.nodes.capture.listed_capture import (
    ListedCapture as ListedCapture,
)
from tactograph.nodes.capture.read_balls import (
    StatedCircles as StatedCircles,
)
from tactograph.nodes.capture.read_capture import (
    CaptureFile as CaptureFile,
    Layout as Layout,
)
from tactograph.nodes.contact.largest_contacts import (
    LargestContacts as LargestContacts,
)
from tactograph.nodes.drawing.new_picture import (
    Colour as Colour,
    NewPicture as NewPicture,
)
from tactograph.nodes.files.calibration_file import (
    FileKind as FileKind,
)
from tactograph.nodes.files.height_files import (
    HeightFile as HeightFile,
)
from tactograph.nodes.files.image_files import (
    Crop as Crop,
    ImageFile as ImageFile,
    Lights as Lights,
)
from tactograph.nodes.files.sensor_identity import (
    SensorIdentity as SensorIdentity,
)
from tactograph.nodes.files.stored_result import (
    StoredResult as StoredResult,
)
from tactograph.nodes.optics.cache_blocks import (
    in_blocks as in_blocks,
)
from tactograph.nodes.optics.camera_view import (
    View as View,
)
from tactograph.nodes.optics.gauss_newton import (
    SlopeNormal as SlopeNormal,
)
from tactograph.nodes.optics.near_light import (
    image_places as image_places,
)
from tactograph.nodes.optics.rest_shape import (
    RestShape as RestShape,
)
from tactograph.nodes.optics.shape import (
    Length as Length,
    Shape as Shape,
    ShapeImage as ShapeImage,
)
from tactograph.nodes.optics.sheet import (
    SheetLight as SheetLight,
)
from tactograph.nodes.stored import (
    Stored as Stored,
)
from tactograph.nodes.stream.touch import (
    Arrows as Arrows,
    Axes as Axes,
    ColourMap as ColourMap,
    LabelMap as LabelMap,
    LayerKind as LayerKind,
    LiveState as LiveState,
    Touch as Touch,
)
from tactograph.nodes.trust.check_ranks import (
    CheckRanks as CheckRanks,
)
from tactograph.nodes.trust.light_departure import (
    LightDeparture as LightDeparture,
)
