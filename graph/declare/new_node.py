"""Write the files of a new node from templates: into the project, or into a package."""

import keyword
import re
from pathlib import Path

import jinja2

from tactograph.graph.declare.find_node import ENTRY_POINT_GROUP, node_names
from tactograph.graph.disk.atomic_files import atomic_file
from tactograph.graph.errors import InputError

NODE_NAME = re.compile(r"[a-z][a-z0-9_]*")


def write_into_project(place: str, root: Path) -> list[Path]:
    """Write ``nodes/ROOM/NAME.py``, its kernel, mutants and test; `place` is ``ROOM/NAME``.

    The parity tests find the node by themselves.

    Raises InputError if `root` is no clone of the project, it has no such room, the name cannot be
    used, or a file is there.
    """
    if not all((root / part).is_dir() for part in ("nodes", "kernels", "pipelines", "tests")):
        raise InputError(
            f"{root}: no clone of tactograph; say --package FOLDER to write the node into a "
            "package of your own"
        )
    room, _, name = place.rpartition("/")
    packages = [p.parent.relative_to(root / "nodes") for p in root.glob("nodes/*/**/__init__.py")]
    rooms = sorted(package.as_posix() for package in packages)
    if room not in rooms:
        raise InputError(f"new-node {place}: say ROOM/{name}, with a room of {', '.join(rooms)}")
    return _write(
        name,
        {
            root / "nodes" / room / f"{name}.py": "node.py.j2",
            root / "kernels" / room / f"{name}.cl": "node.cl.j2",
            root / "kernels" / room / f"{name}.mutants.toml": "node.mutants.toml.j2",
            root / "tests" / "nodes" / room / f"test_{name}.py": "test_node.py.j2",
        },
        module=f"tactograph.nodes.{room.replace('/', '.')}",
        package=False,
    )


def write_into_package(name: str, folder: Path) -> tuple[list[Path], str]:
    """Write the node and its tests into the package in `folder`, which is made if needed.

    Returns the files, and the line that its ``pyproject.toml`` must have, or "" if it has it.
    Raises InputError if the name cannot be used, or a file is there.
    """
    distribution = folder.resolve().name
    module = distribution.replace("-", "_")
    if not module.isidentifier() or keyword.iskeyword(module):
        raise InputError(f"--package {folder}: '{distribution}' cannot be a package's name")
    files = {
        folder / module / f"{name}.py": "node.py.j2",
        folder / module / f"{name}.cl": "node.cl.j2",
        folder / "tests" / f"test_{name}.py": "test_node.py.j2",
    }
    project = folder / "pyproject.toml"
    new = not project.exists()
    if new:
        files[project] = "pyproject.toml.j2"
    written = _write(name, files, module=module, package=True, distribution=distribution)
    start = folder / module / "__init__.py"
    if not start.exists():
        start.write_text('"""Nodes for tactograph."""\n')
        written.append(start)
    line = f'{name} = "{module}.{name}:{name}"'
    return written, "" if new else f'[project.entry-points."{ENTRY_POINT_GROUP}"]  {line}'


def _write(name: str, files: dict[Path, str], **about: object) -> list[Path]:
    if keyword.iskeyword(name):
        raise InputError(f"'{name}' is a Python keyword; give another name")
    if not NODE_NAME.fullmatch(name):
        raise InputError(f"'{name}': a node's name is of lower-case letters, digits and _")
    if name in node_names():
        raise InputError(f"there is a node '{name}' already; give another name")
    for file in files:
        if file.exists():
            raise InputError(f"{file} is there already; nothing was written")
    templates = jinja2.Environment(
        loader=jinja2.PackageLoader("tactograph.graph.declare", "templates"),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,
    )
    for file, template in files.items():
        with atomic_file(file) as target:
            target.write_text(templates.get_template(template).render(name=name, **about))
    return list(files)
