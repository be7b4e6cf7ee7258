"""The content of a recording."""

from collections import Counter
from pathlib import Path

from tactograph.rings.export.summary import Summary
from tactograph.rings.recording.files.mcap_read import McapReader


def show(file: Path) -> Summary:
    """Return duration, topics with their numbers of messages, and damage.

    Raises
    ------
    InputError
        If the file cannot be read at all, or is no recording.
    """
    source, count = McapReader(file), Counter[str]()
    times = []
    for message in source.messages():
        count[message.topic] += 1
        times.append(message.time)
    seconds = (max(times) - min(times)) / 1e9 if times else 0.0
    lines = [
        f"{file}: recording, {seconds:.2f} s, {count.total()} messages",
        *(f"{name}: {value}" for name, value in source.about.items() if len(value) < 200),
        "topics:",
        *(f"  {topic}  {count[topic]}" for topic in sorted(source.topics)),
    ]
    if source.lost:
        lines.append(f"damaged: {source.lost} bytes cannot be read")
    return Summary(lines)
