"""The progress of a node that takes long, for the line that a command shows."""


class _Doing:
    text = ""


def tell_progress(text: str) -> None:
    """Say what the running node is doing, such as "pair 3 of 40"; it lasts until the node ends."""
    _Doing.text = text


def progress_text() -> str:
    """Return the running node's last message; "" if there is none."""
    return _Doing.text
