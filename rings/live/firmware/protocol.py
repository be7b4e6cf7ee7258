"""Lines of the LED controller's protocol: ``$body*CRC`` and a newline.  Both ends use this file.

Only features of MicroPython are used.
"""

VERSION = 1
MAX_LINE_BYTES = 120
"""Most bytes of a line to the controller, from ``$`` to the last digit of the checksum."""


def crc16(data):
    """CRC-16/CCITT-FALSE of bytes: polynomial 0x1021, start 0xFFFF."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = ((crc << 1) ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


def frame(body):
    """The line, as bytes, that carries the text `body`."""
    data = body.encode()
    return b"$" + data + b"*%04X\n" % crc16(data)


def unframe(line):
    """The text in a line without its newline, or None if the line is not complete and valid.

    Every line has exactly one valid spelling, so that a single altered byte is always detected:
    the checksum has capital digits, and ``$`` and ``*`` occur nowhere else.
    """
    if len(line) < 6 or line[:1] != b"$" or line[-5:-4] != b"*":
        return None
    body = line[1:-5]
    if line[-4:] != b"%04X" % crc16(body):
        return None
    for byte in body:
        if byte < 32 or byte > 126 or byte in b"$*":
            return None
    return body.decode()


class Lines:
    """Splits a stream of bytes into lines; invalid lines are counted in `bad`.

    Lines of more than `most` bytes are invalid.
    """

    def __init__(self, most=MAX_LINE_BYTES):
        self.bad = 0
        self._most = most
        self._line = b""
        self._skip = False

    def feed(self, data):
        """Take bytes in; return the bodies of the lines they complete."""
        bodies = []
        parts = data.split(b"\n")
        for i, part in enumerate(parts):
            self._line += part
            if len(self._line) > self._most:
                self._line = b""
                self._skip = True
            if i == len(parts) - 1:
                break
            body = None if self._skip else unframe(self._line)
            # An empty line is what a host sends to end a line that was cut off.
            if body is not None:
                bodies.append(body)
            elif self._skip or self._line:
                self.bad += 1
            self._line = b""
            self._skip = False
        return bodies
