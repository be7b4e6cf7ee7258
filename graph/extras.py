"""Packages that only some features need, and the extra of the installation that brings them."""

from importlib.util import find_spec

from tactograph.graph.errors import InputError


def need(extra: str, feature: str, *packages: str) -> None:
    """Refuse, in one line, a feature whose packages are not installed.

    Raises InputError if one is missing.

    Parameters
    ----------
    extra
        The extra that brings the packages: ``pip install 'tactograph[EXTRA]'``.
    feature
        What needs them, as the message begins.
    packages
        Names under which they are imported.
    """
    missing = [name for name in packages if find_spec(name) is None]
    if missing:
        raise InputError(
            f"{feature} needs {' and '.join(missing)}: pip install 'tactograph[{extra}]'"
        )
