"""Folders of graph files: shipped ones, those of other packages, and the user's own."""

import importlib.util
from importlib import resources
from importlib.metadata import entry_points
from pathlib import Path

from tactograph.graph.errors import InputError, did_you_mean

ENTRY_GROUP = "tactograph.pipelines"


def shipped_graphs() -> dict[str, Path]:
    """The graph files that ship, by bare name."""
    others = {*shipped_overlays().values(), *shipped_studies().values(), *shipped_groups().values()}
    return {file.stem: file for file in _shipped_files("*/*.yaml") if file not in others}


def shipped_overlays() -> dict[str, Path]:
    """The overlays that ship, by bare name."""
    return {file.stem: file for file in _shipped_files("overlays/*.yaml")}


def shipped_studies() -> dict[str, Path]:
    """The studies that ship, by bare name."""
    return {file.stem: file for file in _shipped_files("studies/*.yaml")}


def shipped_groups() -> dict[str, Path]:
    """The files of groups that ship, by name without ``.yaml``."""
    return {file.stem: file for file in _shipped_files("*/*.group.yaml")}


def _shipped_files(pattern: str) -> list[Path]:
    return sorted(Path(str(resources.files(ENTRY_GROUP))).glob(pattern))


def find_file(name: str, base_folder: Path | None, shipped: dict[str, Path]) -> Path | None:
    """The file of a bare name, a ``package/name`` or a path; None if there is no such file.

    A package brings pipelines through the entry-point group ``tactograph.pipelines``: the
    point's name is what is said before the slash, its value the package with the files.

    Raises InputError if the name says where the file is, and it is not there.
    """
    package, slash, graph = name.partition("/")
    if slash and "/" not in graph and (folder := _plugin_folder(package)) is not None:
        if (folder / f"{graph}.yaml").is_file():
            return folder / f"{graph}.yaml"
        known = sorted(file.stem for file in folder.glob("*.yaml"))
        raise InputError(
            f"the package {package} brings no pipeline '{graph}'{did_you_mean(graph, known)}"
            f" (it brings: {', '.join(known) or 'none'})"
        )
    if not is_path(name):
        return shipped.get(name)
    path = Path(name)
    if base_folder is not None and not path.is_absolute():
        path = base_folder / path
    if _is_file(path):
        return path
    if path.name == name and name.removesuffix(".yaml") in shipped:
        return shipped[name.removesuffix(".yaml")]
    raise InputError(f"{path}: there is no such graph file")


def is_path(name: str) -> bool:
    """True if the name is the path of a file."""
    return name.endswith((".yaml", ".yml")) or "/" in name


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that no file can have
        return False


def _plugin_folder(package: str) -> Path | None:
    """The folder of pipelines that an installed package registers under a name."""
    for point in entry_points(group=ENTRY_GROUP, name=package):
        spec = importlib.util.find_spec(point.value)
        for place in (spec and spec.submodule_search_locations) or ():
            return Path(place)
        raise InputError(
            f"the pipelines of {package} should lie in {point.value}; it is no package"
        )
    return None
