"""Packages that only some features need, and the extras that install them."""

from importlib.util import find_spec

from tactograph.graph.errors import InputError


def need(extra: str, feature: str, *packages: str) -> None:
    """Refuse a feature if one of its packages, by import name, is not installed.

    Raises InputError, which names the feature and the extra to install.
    """
    missing = [name for name in packages if find_spec(name) is None]
    if missing:
        raise InputError(
            f"{feature} needs {' and '.join(missing)}: pip install 'tactograph[{extra}]'"
        )
