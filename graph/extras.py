"""Packages that only some features need, and the extra of the installation that brings them."""

from importlib.util import find_spec

from tactograph.graph.errors import InputError


def need(extra: str, feature: str, *packages: str) -> None:
    """Refuse a feature, in a line that begins with it, whose packages are not installed.

    The packages, by the names under which they are imported, come with ``tactograph[EXTRA]``.
    """
    missing = [name for name in packages if find_spec(name) is None]
    if missing:
        raise InputError(
            f"{feature} needs {' and '.join(missing)}: pip install 'tactograph[{extra}]'"
        )
