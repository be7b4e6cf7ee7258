"""A log of ROS 2 messages in MCAP files that survives a kill, a power cut and a full disk.

Every message is its own chunk with a checksum, so that a reader needs neither the end of the
file nor its index (`mcap_read.py`).  One thread writes to the system, which survives the
program's end; another syncs to the disk, which survives the computer's.

All topics are CDR, because ``ros2 bag`` refuses mixed serialisation.
"""

import contextlib
import os
import re
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from annotated_types import Gt, Interval

from tactograph.rings.recording.files.mcap_file import McapFile
from tactograph.rings.recording.files.ros_messages import Message
from tactograph.rings.recording.files.stamps import TouchStamps
from tactograph.sdk import InputError, need, warn

WhenFull = Literal["stop", "oldest"]
FILE_NAME = re.compile(r"(\d{6})_\S*\.mcap")
"""A running number, so that the order does not depend on the computer's clock."""
PATIENCE_S = 0.25
"""Longest wait of a call for its messages to be written; it does not wait if others wait
already."""
RETRY_S = 1.0
"""Pause before a failed disk is tried again."""
CLOSING_S = 10.0
MAX_WAITING_BYTES = 64_000_000
"""Memory for messages that wait for the disk."""
MIN_FILES = 4
"""Fewest files into which the disk space is divided, so that one can be deleted."""


class Limits(NamedTuple):
    """Limits of a log's use of disk and memory.

    Parameters
    ----------
    file_mb : size after which a new file begins
    total_gb : largest total size of all files in the folder
    when_full : at that limit, "stop" writing or delete the "oldest" file
    sync_ms
        Shortest time between two syncs of the disk: what a power cut may cost.  0: after each
        touch, or as often as the disk manages.
    wait
        Let the stream wait for a slow disk instead of leaving touches out; for streams that are
        not live.
    """

    file_mb: Annotated[float, Gt(0)] = 512.0
    total_gb: Annotated[float, Gt(0)] = 50.0
    when_full: WhenFull = "stop"
    sync_ms: Annotated[float, Interval(ge=0, le=60_000)] = 0.0
    wait: bool = False

    @property
    def total_bytes(self) -> float:
        """The size of all files."""
        return 1e9 * self.total_gb

    def ends(self, file: McapFile) -> bool:
        """Return whether the next message belongs into another file."""
        full = min(1e6 * self.file_mb, self.total_bytes / MIN_FILES)
        return file.messages > 0 and file.size >= full


def need_mcap() -> None:
    """Raise an `InputError` that says what to install if the libraries are missing."""
    need("mcap", "an MCAP file", "mcap", "mcap_ros2", "rosbags")


def log_files(folder: Path) -> list[Path]:
    """The files of a log in the order in which they were written."""
    return sorted(f for f in folder.iterdir() if FILE_NAME.fullmatch(f.name))


class McapLog:
    """Writes messages into numbered files in a folder, in its own threads.

    Parameters
    ----------
    folder : created if needed; an existing log is continued in new files
    about : contents of every file's MCAP metadata named "tactograph"
    limits : limits of a file, of the folder, and of the queue

    Attributes
    ----------
    stamps : of its messages
    dropped
        Number of calls whose messages are not in the log, because the disk was too slow, full or
        absent.

    Raises
    ------
    InputError
        If the folder cannot be written at all.
    """

    def __init__(self, folder: Path, about: Mapping[str, str], limits: Limits) -> None:
        need_mcap()
        self.stamps = TouchStamps()
        self._folder, self._about, self._limits = folder, dict(about), limits
        self._queue: deque[tuple[Sequence[Message], int]] = deque()
        self._waiting = 0
        self._accepted = self._done = 0
        self._closing = self._all_written = False
        # Handles of files that are complete but not yet synced.
        self._ended: list[int] = []
        self._changed = threading.Condition()
        self._lines: deque[str] = deque()
        self.dropped = 0
        self._stopped = False
        self._disk_error: OSError | None = None
        self._retry_at = 0.0
        # Value of `dropped` when the disk failed; None while it works.
        self._failed_since: int | None = None
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._old = {file: file.stat().st_size for file in log_files(folder)}
            self._file: McapFile | None = None
            self._next_file()
        except OSError as error:
            raise InputError(f"{folder}: cannot be written: {error.strerror or error}") from None
        self._threads = [
            threading.Thread(target=work, name=f"mcap log {folder.name}", daemon=True)
            for work in (self._run, self._sync_files)
        ]
        for thread in self._threads:
            thread.start()

    def put(self, messages: Sequence[Message]) -> None:
        """Hand over messages that belong together.

        Returns once the system has them in the file, and warns of what has happened since the last
        call.  If the disk takes longer than `PATIENCE_S`, they and later ones wait in the queue.
        If the queue is full and the limits do not say `wait`, they are dropped.
        """
        size = sum(message.size for message in messages)
        with self._changed:
            if self._limits.wait:
                self._changed.wait_for(lambda: not self._queue)
            if self._waiting + size > MAX_WAITING_BYTES and self._queue:
                self._drop()
                self._say("the disk is too slow for the recording; some touches are left out")
            else:
                keeps_up = self._done == self._accepted
                self._queue.append((messages, size))
                self._waiting += size
                self._accepted += 1
                self._changed.notify_all()
                if keeps_up:
                    self._changed.wait_for(lambda: self._done == self._accepted, PATIENCE_S)
        self._tell()

    def _tell(self) -> None:
        while self._lines:
            warn(self._lines.popleft())

    def close(self) -> None:
        """Write the queue, end the file with its index, wait for the disk, report the outcome."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        for thread in self._threads:
            thread.join(CLOSING_S)
        self._tell()

    def _run(self) -> None:
        """Write the queue to files; this is fast, because the system buffers it in memory."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._queue or self._closing)
                if not self._queue:
                    break
                messages, size = self._queue.popleft()
            self._write(messages)
            with self._changed:
                self._waiting -= size
                self._done += 1
                self._changed.notify_all()
        if self._file is not None:
            self._end(self._file)
        with self._changed:
            self._all_written = True
            self._changed.notify_all()

    def _sync_files(self) -> None:
        """Sync written data to the disk, which may take long."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._unsynced() or self._ended or self._all_written)
                handles, self._ended = self._ended, []
                file, size = self._file, 0
                if file is not None:
                    handles.append(os.dup(file.handle))
                    size = file.size
                if not handles:
                    return
            for handle in handles:
                self._sync(handle)
            with self._changed:
                if file is not None:
                    file.synced = size
                self._changed.wait_for(lambda: self._closing, 1e-3 * self._limits.sync_ms)

    def _sync(self, handle: int) -> None:
        try:
            os.fsync(handle)
        except OSError as error:
            self._disk_error = error
        finally:
            os.close(handle)

    def _unsynced(self) -> bool:
        return self._file is not None and self._file.synced < self._file.size

    def _write(self, messages: Sequence[Message]) -> None:
        if self._stopped or time.monotonic() < self._retry_at:
            self._drop()
            return
        try:
            if self._disk_error is not None:
                error, self._disk_error = self._disk_error, None
                raise error
            if self._file is not None and self._limits.ends(self._file):
                self._end(self._file)
            if not self._make_room():
                self._drop()
                return
            file = self._file or self._next_file()
            file.write(messages)
        except OSError as error:
            self._fail(error)
            self._drop()
            return
        except Exception as error:
            # Report any error, because a thread that ends silently would be worse.
            self._stopped = True
            self._say(f"{self._folder}: recording has stopped: {type(error).__name__}: {error}")
            self._drop()
            return
        if self._failed_since is not None:
            missing = self.dropped - self._failed_since
            self._say(f"{self._folder}: recording again; {missing} touches were left out")
            self._failed_since = None

    def _make_room(self) -> bool:
        """Delete the oldest files, or stop, if the folder has reached its limit."""
        limit = self._limits.total_bytes
        used = sum(self._old.values()) + (self._file.size if self._file else 0)
        if used < limit:
            return True
        if self._limits.when_full == "stop":
            self._stopped = True
            self._say(
                f"{self._folder}: holds {used / 1e9:.3g} GB, which is its limit; "
                "recording has stopped"
            )
            return False
        while self._old and used >= limit:
            used -= self._delete(next(iter(self._old)))
        return used < limit

    def _delete(self, path: Path) -> int:
        """Delete an old file; return its size in bytes."""
        path.unlink(missing_ok=True)
        return self._old.pop(path)

    def _fail(self, error: OSError) -> None:
        """Truncate the file to its complete part, report once, and schedule a retry."""
        if self._failed_since is None:
            self._failed_since = self.dropped
            self._say(
                f"{self._folder}: recording is interrupted, {error.strerror or error}; "
                "what was written stays readable"
            )
        file = self._file
        if file is not None:
            file.cut()
            self._put_away(file)
            if not file.messages:
                self._delete(file.path)
        if self._limits.when_full == "oldest" and len(self._old) > 1:
            self._delete(next(iter(self._old)))
        self._retry_at = time.monotonic() + RETRY_S

    def _end(self, file: McapFile) -> None:
        try:
            file.write_index()
        except OSError as error:
            file.cut()
            self._say(
                f"{file.path}: ends without an index, {error.strerror or error}; "
                "what was written stays readable"
            )
        self._put_away(file)

    def _put_away(self, file: McapFile) -> None:
        """Hand the file over for syncing."""
        with self._changed:
            self._file = None
            self._old[file.path] = file.size
            self._ended.append(file.handle)
            self._changed.notify_all()

    def _next_file(self) -> McapFile:
        last = max((int(file.name[:6]) for file in self._old), default=0)
        stamp = datetime.now(UTC).strftime("%Y-%m-%dT%H-%M-%S")
        while True:
            last += 1
            with contextlib.suppress(FileExistsError):
                file = McapFile(self._folder / f"{last:06}_{stamp}.mcap", self._about)
                break
        with self._changed:
            self._file = file
            if os.name != "nt":
                # The folder's entry for the file must be synced, too.
                self._ended.append(os.open(self._folder, os.O_RDONLY))
        return file

    def _drop(self) -> None:
        with self._changed:
            self.dropped += 1

    def _say(self, line: str) -> None:
        if line not in self._lines:
            self._lines.append(line)
