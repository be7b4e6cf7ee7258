"""What the LED controller's lines say: answers and events.

The protocol is described in rings/live/docs/hardware.md; ``firmware/protocol.py`` frames lines.
"""

import re
from dataclasses import dataclass

MAX_ANSWER_BYTES = 400
"""Most bytes of a line from the controller."""
MAX_NUMBER = 10**15
"""Largest number in a line: 31 years in microseconds, which a float holds to 0.1 us."""
_WHOLE_NUMBER = re.compile(r"-?[0-9]{1,16}")


@dataclass(frozen=True)
class Answer:
    """The controller's answer to the request `number`.

    `values` are its ``key=value`` words; `refusal` is the reason if it refused.
    """

    number: int
    values: dict[str, str]
    refusal: str | None = None


@dataclass(frozen=True)
class Event:
    """An unsolicited message from the controller: ``cycle``, ``ready`` or ``watchdog``."""

    name: str
    words: tuple[str, ...]


def whole_number(word: str, least: int = 0, most: int = MAX_NUMBER) -> int:
    """The whole number that `word` spells.

    Raises
    ------
    ValueError
        If it is none, or out of its range.
    """
    if not _WHOLE_NUMBER.fullmatch(word) or not least <= int(word) <= most:
        raise ValueError(f"{word[:20]} is no whole number from {least} to {most}")
    return int(word)


def parse(body: str) -> Answer | Event | None:
    """Parse a body from the controller; None if it does not follow the protocol."""
    words = body.split(" ")
    if words[0] == "!" and len(words) > 1:
        return Event(words[1], tuple(words[2:]))
    try:
        number = whole_number(words[0])
    except ValueError:
        return None
    if len(words) < 2:
        return None
    if words[1] == "no":
        return Answer(number, {}, " ".join(words[2:]) or "refused")
    pairs = [word.partition("=") for word in words[2:]]
    if words[1] != "ok" or any(not equals for _, equals, _ in pairs):
        return None
    return Answer(number, {key: value for key, _, value in pairs})
