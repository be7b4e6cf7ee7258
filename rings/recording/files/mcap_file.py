"""One MCAP file of a log: complete after every write, and readable without its index."""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, cast

from tactograph.rings.recording.files.ros_messages import Message

if TYPE_CHECKING:
    from mcap.records import Schema


class McapFile:
    """One MCAP file: complete up to `size`, synced to the disk up to `kept`."""

    def __init__(self, path: Path, about: Mapping[str, str]) -> None:
        from mcap_ros2.writer import Writer
        from rosbags.typesys import Stores, get_typestore

        self.path = path
        self.handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        self.size = self.synced = self.messages = 0
        self._pending = _Pending()
        # Chunks of size 0: each message ends its chunk.
        self._writer = Writer(cast(IO[Any], self._pending), chunk_size=0)
        # The files carry ROS's own definitions, so that a reader does not need ROS.
        self._ros = get_typestore(Stores.ROS2_HUMBLE)
        self._schemas: dict[str, Schema] = {}
        self._writer.add_metadata("tactograph", dict(about))
        try:
            self._flush()
        except OSError:
            os.close(self.handle)
            path.unlink(missing_ok=True)
            raise

    def write(self, messages: Sequence[Message]) -> None:
        for message in messages:
            if message.type not in self._schemas:
                definition, _ = self._ros.generate_msgdef(message.type, ros_version=2)
                self._schemas[message.type] = self._writer.register_msgdef(message.type, definition)
            self._writer.write_message(
                message.topic,
                self._schemas[message.type],
                message.body,
                log_time=message.time,
                sequence=message.sequence,
            )
        self._flush()
        self.messages += len(messages)

    def write_index(self) -> None:
        self._writer.finish()
        self._flush()

    def cut(self) -> None:
        """Remove a message that was only partly written."""
        with contextlib.suppress(OSError):
            os.ftruncate(self.handle, self.size)

    def _flush(self) -> None:
        data = memoryview(self._pending.take())
        length = len(data)
        while data:
            data = data[os.write(self.handle, data) :]
        self.size += length


class _Pending(io.BufferedIOBase):
    """Collects the bytes that the MCAP library has written since the last `take`."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._at = 0

    def write(self, data: Any) -> int:
        self._parts.append(bytes(data))
        self._at += len(data)
        return len(data)

    def tell(self) -> int:
        return self._at

    def take(self) -> bytes:
        parts, self._parts = self._parts, []
        return b"".join(parts)
