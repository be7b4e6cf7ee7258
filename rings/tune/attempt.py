"""Changes that may be refused."""

from collections.abc import Callable
from typing import Any

from nicegui import ui

from tactograph.sdk import TactographError


def attempt(change: Callable[..., object], *words: Any) -> bool:
    """Make a change, and return whether it was made; a refusal is shown and changes nothing."""
    try:
        change(*words)
    except TactographError as error:
        ui.notify(" ".join(str(error).split()), type="negative", multi_line=True)
        return False
    return True
