"""Rings: packages that bring nodes, kernels, graphs and commands; the core is the first of them.

A package registers itself by one entry point of the group ``tactograph.rings``, whose name is
the ring's and whose value the package.  The contents of its folder are found by place and file
name:

==============================  ============================================================
``nodes/**/NAME.py``            node NAME, declared by ``@node``
``kernels/**/NAME.cl``          its kernels, in the same room
``judges/NAME.py``              doubts of a calibration with a ball: ``doubts`` (`ring_doubts`)
``calibrations/NAME_kind.py``   files of calibrations of a kind (`nodes.calibrate.kinds`)
``layers/NAME.py``              layer NAME of a touch: its ``KIND`` (`nodes.stream.touch`)
``pipelines/FOLDER/NAME.yaml``  graph NAME; in ``overlays``, ``studies`` an overlay, a study;
                                in ``variants`` variants of another package's graph NAME
``verbs/NAME.py``               ``tactograph NAME``, a click command called ``command``
``formats/EXT.py``              files ``.EXT`` of heights: functions ``read``, ``write``
``show/EXT.py``                 what ``tactograph show`` prints of ``NAME.EXT``: ``show``
``captures/NAME.py``            folders of images that a ``NAME.yaml`` lists: ``read``
``sensors/NAME.yaml``           preset NAME of a sensor
==============================  ============================================================

No module of a package is imported before a graph or a command names it.
"""

import importlib
import importlib.util
import re
import sys
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType

from tactograph.graph.errors import NodeError, message_of

ENTRY_POINT_GROUP = "tactograph.rings"
CORE_PACKAGE = "tactograph"


@dataclass(frozen=True)
class Ring:
    """A package that brings nodes, graphs and commands."""

    name: str
    package: str
    distribution: str
    places: Mapping[str, tuple[str, Path]]
    """The package and the folder of each kind of files that it brings."""

    @property
    def shipped(self) -> bool:
        """Whether it comes with tactograph itself."""
        return self.distribution == CORE_PACKAGE

    def files(self, kind: str, pattern: str) -> list[Path]:
        """The files of one kind, sorted by path; none if the ring brings none."""
        return sorted(self.places[kind][1].glob(pattern)) if kind in self.places else []

    def module(self, kind: str, file: Path) -> str:
        """The name of the module in a file of `files`."""
        package, folder = self.places[kind]
        return ".".join((package, *file.relative_to(folder).with_suffix("").parts))


def rings() -> tuple[Ring, ...]:
    """The core, then the rings of installed packages by name; a broken ring gives a warning."""
    return _rings(tuple(sys.path))


@cache
def _rings(path: tuple[str, ...]) -> tuple[Ring, ...]:
    """The rings on `path`; cached, since reading the metadata of all packages takes long."""
    points = sorted(entry_points(group=ENTRY_POINT_GROUP), key=lambda point: point.name)
    return (_core(), *_readable(points))


@dataclass(frozen=True)
class Brought:
    """A file of one kind that a ring brings."""

    ring: Ring
    kind: str
    file: Path

    def load(self) -> ModuleType:
        """Import a module.  Raises NodeError, which names the ring, if that fails."""
        try:
            return importlib.import_module(self.ring.module(self.kind, self.file))
        except Exception as error:
            raise NodeError(
                f"{self.kind}/{self.file.name} of ring '{self.ring.name}' cannot be loaded: "
                f"{message_of(error) or type(error).__name__}"
            ) from error


def brought(kind: str, suffix: str = "py") -> dict[str, Brought]:
    """The files of one kind that rings bring, by file name; the first ring has precedence."""
    names: dict[str, Brought] = {}
    for ring in rings():
        for file in ring.files(kind, f"[!_]*.{suffix}"):
            names.setdefault(file.stem, Brought(ring, kind, file))
    return names


def bring(kind: str, name: str) -> ModuleType | None:
    """Import the module of this kind and name; None if no ring has it.

    Raises NodeError, which names the ring, if it cannot be imported.
    """
    entry = brought(kind).get(name)
    return None if entry is None else entry.load()


def _core() -> Ring:
    packages = {kind: f"{CORE_PACKAGE}.{kind}" for kind in ("nodes", "kernels", "pipelines")}
    packages["layers"] = f"{packages['nodes']}.layers"
    packages["calibrations"] = f"{packages['nodes']}.calibrate.kinds"
    folders = {kind: (package, _folder(package)) for kind, package in packages.items()}
    places = {kind: (package, folder) for kind, (package, folder) in folders.items() if folder}
    return Ring("core", CORE_PACKAGE, CORE_PACKAGE, places)


def _readable(points: list[EntryPoint]) -> Iterator[Ring]:
    """The rings whose package exists and accepts this version; a warning for each other ring."""
    for point in points:
        folder = _folder(point.value)
        distribution = point.dist.name if point.dist else point.value.partition(".")[0]
        wrong, needs = "", "" if distribution == CORE_PACKAGE else _other_version(point)
        if folder is None:
            wrong = f": there is no package {point.value}; install it again, or uninstall it"
        elif needs:
            wrong = f" takes {needs}, not the installed version; install one of them"
        if folder is None or wrong:
            warnings.warn(f"ring '{point.name}' of {distribution}{wrong}", stacklevel=2)
            continue
        inside = sorted(each for each in folder.iterdir() if each.is_dir())
        places = {each.name: (f"{point.value}.{each.name}", each) for each in inside}
        yield Ring(point.name, point.value, distribution, places)


def _folder(package: str) -> Path | None:
    """The folder of a package, found without importing it; None if there is none."""
    try:
        spec = importlib.util.find_spec(package)
    except (ImportError, ValueError):
        return None
    places = (spec and spec.submodule_search_locations) or ()
    return next((Path(place) for place in places if Path(place).is_dir()), None)


def _other_version(point: EntryPoint) -> str:
    """What a ring's distribution requires of tactograph, if the installed version is another."""
    from packaging.requirements import InvalidRequirement, Requirement

    from tactograph import __version__

    for text in (point.dist and point.dist.requires) or ():
        try:
            need = Requirement(text)
        except InvalidRequirement:
            continue
        is_this = re.sub(r"[-_.]+", "-", need.name).lower() == CORE_PACKAGE
        if is_this and not need.specifier.contains(__version__, prereleases=True):
            return f"{CORE_PACKAGE} {need.specifier}"
    return ""
