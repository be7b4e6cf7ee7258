"""One worker: this process."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from tactograph.graph.batch.worker import Answer, Chunk, Tally, do_chunks


class Serial:
    """Does one chunk after the other, here."""

    name = "this process"

    def ask(self, question: Callable[..., Answer], *about: Any) -> Answer:
        """Have a question answered, here."""
        return question(*about)

    def run(self, chunks: Iterable[Chunk]) -> Iterator[Tally]:
        """Do every chunk, and yield how each went."""
        return do_chunks(chunks)
