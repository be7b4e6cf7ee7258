"""Requests and answers over an open serial port, which a separate thread reads."""

import contextlib
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import serial

from tactograph.rings.live.firmware.protocol import Lines, frame
from tactograph.rings.live.nodes.controller._led_line import MAX_ANSWER_BYTES, Answer, Event, parse
from tactograph.sdk import InputError, TactographError

MAX_ATTEMPTS = 4
"""Attempts after which a request counts as unanswered; repetition does no harm."""


class ControllerLostError(TactographError):
    """The LED controller does not answer, or its port is gone."""


class ControllerRefusedError(InputError):
    """The LED controller refused a request, with a reason."""


@dataclass(frozen=True)
class Reply:
    """An answer's values, and the times of time.monotonic() between which it was given."""

    values: dict[str, str]
    sent: float
    received: float


class Link:
    """A connection over one open port; any thread may send requests.

    Parameters
    ----------
    port : an open port; the link closes it
    timeout_s : longest time that a request may take, including all repetitions
    on_event : called by the reading thread with each event and its time of arrival
    on_loss : called by the reading thread when the port fails
    """

    def __init__(
        self,
        port: serial.SerialBase,
        timeout_s: float,
        on_event: Callable[[Event, float], None],
        on_loss: Callable[[], None],
    ) -> None:
        self.lost = False
        self.bytes = 0
        self._port = port
        self._timeout = timeout_s
        self._on_event = on_event
        self._on_loss = on_loss
        self._lines = Lines(MAX_ANSWER_BYTES)
        self._turn = threading.Lock()
        self._changed = threading.Condition()
        self._number = 0
        self._answer: tuple[Answer, float] | None = None
        self._closing = False
        self._thread = threading.Thread(target=self._read, name="LED controller", daemon=True)
        self._thread.start()
        # Ends an incomplete line that an earlier program may have left.
        self._write(b"\n")

    @property
    def bad(self) -> int:
        """Number of damaged lines received."""
        return self._lines.bad

    def request(self, body: str) -> Reply:
        """Send a request and wait for the answer.

        Raises
        ------
        ControllerLostError
            If no answer comes in time, or the port fails.
        ControllerRefusedError
            With the controller's reason.
        """
        with self._turn:
            self._number += 1
            line = frame(f"{self._number} {body}")
            sent = time.monotonic()
            for _ in range(MAX_ATTEMPTS):
                self._write(line)
                arrival = self._wait(self._timeout / MAX_ATTEMPTS)
                if arrival is not None:
                    answer, received = arrival
                    if answer.refusal is not None:
                        reason = f"the LED controller refuses '{body}': {answer.refusal}"
                        raise ControllerRefusedError(reason)
                    return Reply(answer.values, sent, received)
            raise ControllerLostError(
                f"the LED controller gave no answer within {self._timeout:g} s"
            )

    def close(self) -> None:
        """Stop reading and close the port."""
        self._closing = True
        if threading.current_thread() is not self._thread:
            self._thread.join(1)
        with contextlib.suppress(OSError):
            self._port.close()

    def _write(self, data: bytes) -> None:
        try:
            if self.lost:
                raise OSError
            self._port.write(data)
        except (OSError, TypeError, AttributeError):
            # pyserial's own errors are OSErrors; a port that was just closed raises the others.
            self._lose()
            raise ControllerLostError("the connection to the LED controller is lost") from None

    def _wait(self, seconds: float) -> tuple[Answer, float] | None:
        def is_over() -> bool:
            return self.lost or (
                self._answer is not None and self._answer[0].number == self._number
            )

        with self._changed:
            self._changed.wait_for(is_over, seconds)
            if self.lost:
                raise ControllerLostError("the connection to the LED controller is lost")
            return self._answer if is_over() else None

    def _read(self) -> None:
        try:
            self._take_in()
        finally:
            # Whatever ended it: requests that no thread reads answers of must not wait.
            if not self._closing:
                self._lose()

    def _take_in(self) -> None:
        while not self._closing and not self.lost:
            try:
                data = self._port.read(max(1, self._port.in_waiting))
            except (OSError, TypeError, AttributeError):
                break
            now = time.monotonic()
            self.bytes += len(data)
            for message in map(parse, self._lines.feed(data)):
                if message is None:
                    self._lines.bad += 1
                elif isinstance(message, Event):
                    self._on_event(message, now)
                else:
                    with self._changed:
                        self._answer = message, now
                        self._changed.notify_all()

    def _lose(self) -> None:
        with self._changed:
            before, self.lost = self.lost, True
            self._changed.notify_all()
        if not before:
            self._on_loss()
