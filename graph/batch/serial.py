"""One worker: this process."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from tactograph.graph.batch.worker import Chunk, Tally, do_chunks


class Serial:
    """Does one chunk after the other, here."""

    name = "this process"

    def run(self, chunks: Iterable[Chunk]) -> Iterator[Tally]:
        """Do every chunk, and yield how each went."""
        return do_chunks(chunks)
