"""Records of when each step ran, as Chrome trace events for Perfetto (ui.perfetto.dev)."""

import json
import threading
from pathlib import Path
from typing import Any

from tactograph.graph.disk.atomic_files import atomic_file
from tactograph.graph.errors import warn
from tactograph.graph.plan.plan import Plan

MAX_EVENTS = 200_000
"""The most spans of a trace; an endless stream would fill the memory."""
_LANE_NUMBERS = {"device": 1, "transfers": 2}


class Trace:
    """Spans of time, each in the lane of a host thread, of the device or of its transfers.

    `lanes` numbers them by name.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._events: list[dict[str, Any]] = []
        self.lanes = dict(_LANE_NUMBERS)
        self._steps = {step.name: step for step in plan.steps}

    def on_host(self, name: str, end: float, milliseconds: float, thread: str = "") -> None:
        """A span of a thread, else of the calling one; `end` is a time of `time.perf_counter`."""
        lane = f"host, {thread or threading.current_thread().name}"
        self.lanes.setdefault(lane, len(self.lanes) + 1)
        self._add(name, lane, end - 1e-3 * milliseconds, end)

    def on_device(self, name: str, start: float, end: float) -> None:
        """A span of the device's clock, converted to the host's."""
        moves = self._steps[name].is_transfer
        self._add(name, "transfers" if moves else "device", start, end)

    def write(self, file: Path) -> None:
        """Write the file, whole or not at all.  Raises WriteError if it cannot be written."""
        named = [
            {"ph": "M", "pid": 1, "tid": number, "name": "thread_name", "args": {"name": lane}}
            for lane, number in self.lanes.items()
        ]
        first = min((event["ts"] for event in self._events), default=0.0)
        events = [{**event, "ts": round(event["ts"] - first, 3)} for event in self._events]
        about = {"graph": self._plan.graph.name, "hash": self._plan.graph.hash}
        with atomic_file(file) as target:
            target.write_text(
                json.dumps({"traceEvents": [*named, *events], "otherData": about}), encoding="utf-8"
            )

    def _add(self, name: str, lane: str, start: float, end: float) -> None:
        if len(self._events) >= MAX_EVENTS:
            warn(f"the trace ends after {MAX_EVENTS} spans")
            return
        task = self._plan.tasks.get(name)
        self._events.append(
            {
                "ph": "X",
                "pid": 1,
                "tid": self.lanes[lane],
                "name": name,
                "cat": task.node.name if task else self._steps[name].kind,
                "ts": 1e6 * start,
                "dur": round(1e6 * (end - start), 3),
            }
        )
