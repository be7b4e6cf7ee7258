"""Ctrl-C, heard where it does no harm."""

import signal
import sys
import threading
import time
from types import FrameType

RETRY_S = 0.02
"""Pause before Ctrl-C is sent again."""
PATIENCE_S = 5.0
"""An import that takes longer than that is interrupted all the same."""
_first: float | None = None


def listen() -> None:
    """Let Ctrl-C wait for the end of an import, unless the shell has it ignored."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)


def interrupt(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt as Python does, but not into an import: then behind it.

    Extension modules make an ImportError of it there, or abort the process.
    """
    global _first
    now = time.monotonic()
    _first = now if _first is None else _first
    if _is_in_import(frame) and now - _first < PATIENCE_S:
        timer = threading.Timer(RETRY_S, _send, [number])
        timer.daemon = True
        timer.start()
        return
    _first = None
    signal.default_int_handler(number, frame)


def raise_heard() -> None:
    """Raise what waits for the end of an import that is over."""
    if _first is not None:
        raise KeyboardInterrupt


def _is_in_import(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            return True
        frame = frame.f_back
    return False


def _send(number: int) -> None:
    """Send the main thread a signal; it may be waiting for something by now."""
    if sys.platform == "win32":
        signal.raise_signal(number)
    else:
        signal.pthread_kill(threading.main_thread().ident or 0, number)
