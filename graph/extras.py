"""Packages that only some features need, and the extra of the installation that brings them."""

from importlib.util import find_spec

from tactograph.graph.errors import InputError


def need(extra: str, feature: str, *packages: str) -> None:
    """Refuse a feature whose packages, named as they are imported, are not all installed.

    Raises InputError, which begins with the feature and names the extra that brings them.
    """
    missing = [name for name in packages if find_spec(name) is None]
    if missing:
        raise InputError(
            f"{feature} needs {' and '.join(missing)}: pip install 'tactograph[{extra}]'"
        )
