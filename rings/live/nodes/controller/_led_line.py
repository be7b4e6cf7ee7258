"""The lines between host and LED controller: framing, checksum and content.

The protocol is described in rings/live/docs/hardware.md; ``firmware/protocol.py`` is the other end.
"""

import binascii
import re
from dataclasses import dataclass, field

PROTOCOL_VERSION = 1
"""The version of the protocol."""
MAX_LINE_BYTES = 400
"""Most bytes of a line."""
_CHECKED_LINE = re.compile(rb"\$([ -#%-)+-~]*)\*([0-9A-F]{4})")
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


def frame(body: str) -> bytes:
    """The line that carries `body`, which is plain ASCII without ``$`` and ``*``."""
    data = body.encode("ascii")
    return b"$%s*%04X\n" % (data, binascii.crc_hqx(data, 0xFFFF))


def unframe(line: bytes) -> str | None:
    """The body of a line without its newline; None if it was damaged in transit."""
    match = _CHECKED_LINE.fullmatch(line)
    if match is None or binascii.crc_hqx(match[1], 0xFFFF) != int(match[2], 16):
        return None
    return match[1].decode("ascii")


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


@dataclass
class Lines:
    """Splits a stream of bytes into the controller's messages, and counts damaged lines in `bad`.

    After garbage or a truncated line, the next complete line is understood again.
    """

    bad: int = 0
    _rest: bytes = field(default=b"", repr=False)

    def feed(self, data: bytes) -> list[Answer | Event]:
        """Take in bytes; return the messages that they complete."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > MAX_LINE_BYTES:
            # The tail of an overlong line must not pass as a line: keep a byte that spoils it.
            self._rest = b"?"
        messages = []
        for line in lines:
            body = unframe(line)
            message = parse(body) if body is not None else None
            if message is not None:
                messages.append(message)
            elif line:
                self.bad += 1
        return messages
