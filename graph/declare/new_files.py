"""Write the files of a new node, or of a new ring, from templates."""

import keyword
import re
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

import jinja2

from tactograph import __version__
from tactograph.graph.declare.find_node import node_names
from tactograph.graph.disk.atomic_files import write_file
from tactograph.graph.errors import InputError
from tactograph.graph.rings import rings

NODE_NAME = re.compile(r"[a-z][a-z0-9_]*")
NODE_FILES = {
    "nodes/{room}{name}.py": "node.py.j2",
    "kernels/{room}{name}.cl": "node.cl.j2",
    "kernels/{room}{name}.mutants.toml": "node.mutants.toml.j2",
}
"""Templates of a node's files, by their paths in the core or in a ring."""
RING_FILES = {
    "pyproject.toml": "pyproject.toml.j2",
    "{package}/__init__.py": "package.py.j2",
    "{package}/nodes/__init__.py": "empty.py.j2",
    "{package}/kernels/__init__.py": "empty.py.j2",
    **{f"{{package}}/{file}": template for file, template in NODE_FILES.items()},
    "{package}/pipelines/{ring}/{name}_paper.yaml": "graph.yaml.j2",
    "{package}/layers/__init__.py": "empty.py.j2",
    "{package}/layers/{name}.py": "layer.py.j2",
    "{package}/verbs/__init__.py": "empty.py.j2",
    "{package}/verbs/{name}.py": "verb.py.j2",
    "tests/test_{name}.py": "test_node.py.j2",
    "tests/test_ring.py": "test_ring.py.j2",
}
"""Templates of the files of a ring's package, by their paths."""


def write_node(place: str, root: Path) -> list[Path]:
    """Write ``nodes/ROOM/NAME.py``, its kernel, mutants and test; `place` is ``ROOM/NAME``.

    The parity tests find the node by themselves.

    Raises InputError if `root` has no nodes or no such room, if the name is taken or no identifier,
    or if a file exists.
    """
    if not (root / "nodes").is_dir() or not (root / "kernels").is_dir():
        raise InputError(
            f"{root}: neither a clone of tactograph nor a ring: it lacks the folders nodes and "
            "kernels; --ring names the folder that has them, and 'tactograph new-ring' makes one"
        )
    room, _, name = place.rpartition("/")
    packages = [p.parent.relative_to(root / "nodes") for p in root.glob("nodes/**/__init__.py")]
    rooms = sorted({package.as_posix() for package in packages} - {"."})
    if rooms and room not in rooms:
        raise InputError(f"new-node {place}: write ROOM/{name}; rooms are {', '.join(rooms)}")
    is_core = (root / "graph").is_dir()
    test = f"tests/{'nodes/' if is_core else ''}{{room}}test_{{name}}.py"
    package = "tactograph" if is_core else _package_of(root)
    where = {"name": name, "room": f"{room}/" if room else ""}
    return _write(
        name,
        _placed({**NODE_FILES, test: "test_node.py.j2"}, root, where),
        module=".".join(filter(None, (package, "nodes", room.replace("/", ".")))),
        ring="" if is_core else root.resolve().name,
    )


def write_ring(folder: Path, name: str) -> list[Path]:
    """Write the package of a ring, with a node, a kernel, a graph, a command and tests.

    Raises InputError if a name cannot be used, or if a file exists.
    """
    distribution = folder.resolve().name
    package = distribution.replace("-", "_")
    if not (package.isascii() and package.isidentifier()) or keyword.iskeyword(package):
        raise InputError(f"new-ring {folder}: '{distribution}' cannot be a package's name")
    ring = package.removeprefix("tactograph_")
    installed = find_spec(package)
    if any(each.name == ring for each in rings()) or (installed and installed.origin):
        raise InputError(f"new-ring {folder}: '{ring}' is installed already; name another folder")
    major, minor = (int(part) for part in __version__.split(".")[:2])
    versions = f">={major}.{minor},<{major}.{minor + 1}"
    where = {"name": name, "room": "", "package": package, "ring": ring}
    files = _placed(RING_FILES, folder, where)
    about = {"package": package, "ring": ring, "distribution": distribution, "versions": versions}
    return _write(name, files, module=f"{package}.nodes", **about)


def _package_of(folder: Path) -> str:
    """The package in a ring's folder: the registered one, else one named after the folder."""
    nodes = (folder / "nodes").resolve()
    packages = {r.places["nodes"][1]: r.package for r in rings() if "nodes" in r.places}
    return packages.get(nodes, nodes.parent.name)


def _placed(files: Mapping[str, str], root: Path, where: Mapping[str, str]) -> dict[Path, str]:
    return {root / file.format(**where): template for file, template in files.items()}


def _write(name: str, files: dict[Path, str], **about: str) -> list[Path]:
    if keyword.iskeyword(name):
        raise InputError(f"'{name}' is a Python keyword; give another name")
    if not NODE_NAME.fullmatch(name):
        raise InputError(f"'{name}': write a node's name in lower-case letters, digits and _")
    if name in node_names():
        raise InputError(f"node '{name}' exists already; give another name")
    for file in files:
        if file.exists():
            raise InputError(f"{file} exists already; nothing was written")
    templates = jinja2.Environment(
        loader=jinja2.PackageLoader("tactograph.graph.declare", "templates"),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,
    )
    for file, template in files.items():
        write_file(file, templates.get_template(template).render(name=name, **about))
    return list(files)
