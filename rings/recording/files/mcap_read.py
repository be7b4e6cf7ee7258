"""Read MCAP files up to the first damage, with or without an end."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from tactograph.rings.recording.files.mcap_log import need_mcap
from tactograph.sdk import InputError

if TYPE_CHECKING:
    from mcap.records import Channel, Message, Schema

MCAP_MAGIC = b"\x89MCAP0\r\n"
MAX_BYTES = 2**28
"""Largest record, and largest chunk after decompression: a quarter of a gigabyte."""
LZ4_RATIO = 255
"""Largest compression ratio of LZ4."""
_OPCODE_AND_LENGTH = struct.Struct("<BQ")


@dataclass(frozen=True)
class McapMessage:
    """One message of a file, decoded from ROS 2's serialisation."""

    topic: str
    time: int
    sequence: int
    body: Any


@dataclass
class McapReader:
    """One file; iterate over `messages`, then check `lost` and `has_end`.

    Attributes
    ----------
    about : the metadata named "tactograph"; complete before the first message
    lost : bytes that could not be read: a record cut off by the file's end, or damaged
    has_end : whether its data ends where its writer ended it
    topics : all topics found so far
    """

    path: Path
    about: dict[str, str] = field(default_factory=dict)
    lost: int = 0
    has_end: bool = False
    topics: set[str] = field(default_factory=set)

    def messages(self) -> Iterator[McapMessage]:
        """Yield the messages in the file's order, skipping chunks whose checksum is wrong.

        Raises
        ------
        InputError
            If it cannot be read at all, or is not an MCAP file.
        """
        need_mcap()
        try:
            with self.path.open("rb") as stream:
                start = stream.read(len(MCAP_MAGIC))
                if not MCAP_MAGIC.startswith(start) and start.strip(b"\0"):
                    raise InputError(f"{self.path}: is no MCAP file, or damaged at its start")
                yield from self._decoded(stream)
        except OSError as error:
            raise InputError(f"{self.path}: {error.strerror or error}") from None

    def _decoded(self, stream: IO[bytes]) -> Iterator[McapMessage]:
        from mcap.records import Channel, Schema
        from mcap_ros2.decoder import DecoderFactory

        decoders = DecoderFactory()
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        for record in self._records(stream):
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
                self.topics.add(record.topic)
            elif record.channel_id not in channels:
                self.lost += len(record.data)
            else:
                channel = channels[record.channel_id]
                schema = schemas.get(channel.schema_id)
                try:
                    # None if there is no schema, or it is not ROS 2's.
                    decode = decoders.decoder_for(channel.message_encoding, schema)
                    body = None if decode is None else decode(record.data)
                except Exception:  # definitions and messages are parsed as they come
                    self.lost += len(record.data)
                    continue
                if body is not None:
                    yield McapMessage(channel.topic, record.log_time, record.sequence, body)

    def _records(self, stream: IO[bytes]) -> Iterator[Schema | Channel | Message]:
        from mcap.data_stream import ReadDataStream
        from mcap.opcode import Opcode
        from mcap.records import Channel, Chunk, Message, Metadata, Schema
        from mcap.stream_reader import breakup_chunk

        # The library's own reader stops at damage without saying where.  This one steps from
        # record to record by their lengths and lets the library decode the contents.
        for opcode, payload in self._payloads(stream):
            data = ReadDataStream(io.BytesIO(payload))
            records: list[Any] = []
            try:
                if opcode == Opcode.CHUNK:
                    chunk = Chunk.read(data)
                    _check_size(chunk.compression, chunk.uncompressed_size, chunk.data)
                    records = breakup_chunk(chunk, validate_crc=True)
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    records = [(Schema if opcode == Opcode.SCHEMA else Channel).read(data)]
                elif opcode == Opcode.MESSAGE:
                    records = [Message.read(data, len(payload))]
                elif opcode == Opcode.METADATA:
                    metadata = Metadata.read(data)
                    if metadata.name == "tactograph":
                        self.about = metadata.metadata
                elif opcode == Opcode.DATA_END:
                    self.has_end = True
                    return
            except _damage():
                self.lost += len(payload)
            yield from records

    def _payloads(self, stream: IO[bytes]) -> Iterator[tuple[int, bytes]]:
        """The complete records of the file."""
        size = stream.seek(0, io.SEEK_END)
        at = stream.seek(min(len(MCAP_MAGIC), size))
        while size - at >= _OPCODE_AND_LENGTH.size:
            opcode, length = _OPCODE_AND_LENGTH.unpack(stream.read(_OPCODE_AND_LENGTH.size))
            # After a power cut some file systems leave zeros where data should be.
            if opcode == 0 or length > size - at - _OPCODE_AND_LENGTH.size:
                break
            if length > MAX_BYTES:
                stream.seek(length, io.SEEK_CUR)
                self.lost += length
            else:
                yield opcode, stream.read(length)
            at += _OPCODE_AND_LENGTH.size + length
        self.lost += size - at


def _check_size(compression: str, unpacked: int, data: bytes) -> None:
    """Refuse a chunk that would unpack to more than `MAX_BYTES`, whatever size it declares."""
    import lz4.frame
    import zstandard

    size = unpacked
    if compression == "zstd":
        size = max(size, zstandard.frame_content_size(data))
    elif compression == "lz4" and len(data) * LZ4_RATIO > MAX_BYTES:
        size = max(
            size, len(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=MAX_BYTES + 1))
        )
    if size > MAX_BYTES:
        raise ValueError(f"a chunk of {size} bytes")


def _damage() -> tuple[type[Exception], ...]:
    """The errors that the libraries raise for a damaged record."""
    from mcap.exceptions import McapError
    from zstandard import ZstdError

    decoding = (ValueError, RuntimeError, KeyError, MemoryError, OverflowError, struct.error)
    return (McapError, ZstdError, *decoding)
