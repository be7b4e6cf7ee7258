"""One worker: this process."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from tactograph.graph.batch.worker import Answer, Chunk, Tally, do_chunks


class Serial:
    """Does one chunk after the other in this process."""

    name = "this process"

    def ask(self, question: Callable[..., Answer], *about: Any) -> Answer:
        """Answer a question here."""
        return question(*about)

    def run(self, chunks: Iterable[Chunk]) -> Iterator[Tally]:
        """Do every chunk, and yield the tally of each."""
        return do_chunks(chunks)
