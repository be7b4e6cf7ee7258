"""Statistics of a stream of heights: rate, latency, faults, error, memory."""

import json
import resource
import sys
import time
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Gt

from tactograph.sdk import Height, LiveState, Port, Provenance, Session, atomic_files, node

BIN_S = 1e-4
"""Width of the bins that count latencies, so that memory does not grow with time."""
MAX_LATENCY_S = 5.0
"""Upper end of the last bin, which also counts longer latencies."""
MIN_TRUST = 0.01
"""Heights with less trust count as doubtful, as `judge_touch` has it."""
WARM_UP_S = 2.0
"""Time left out at the start, in which kernels are compiled and caches filled."""


@node
def live_statistics(
    height: Height,
    time: Annotated[float, Port(unit="s")],
    state: LiveState,
    truth: Height | None = None,
    contact: dict[str, float] | None = None,
    *,
    folder: Path | None = None,
    every_s: Annotated[float, Gt(0)] = 1.0,
    session: Session,
    provenance: Provenance,
) -> None:
    """Count the heights of a stream, report while it runs, and summarise at its end.

    Parameters
    ----------
    height : H x W in mm above the film at rest
    time : the end of its newest exposure, in s of ``time.monotonic()``
    state : the stream's counters
    truth : H x W in mm, if known: the true height at the newest exposure
    contact : figures of the touch, as `measure_contact` and `judge_touch` return them
    folder : folder for ``result.json`` at the end of the stream; None: it is not written
    every_s : time between two lines on the terminal
    """
    statistics = session.keep(lambda: Statistics(folder, every_s))
    statistics.take(height, time, state, truth, provenance, contact)


class Statistics:
    """Running statistics of a stream, in bounded memory."""

    def __init__(self, folder: Path | None = None, every_s: float = 1.0) -> None:
        self._folder, self._every = folder, every_s
        self._start = self._reported_s = time.monotonic()
        self._heights = self._heights_reported = 0
        self._first = self._last = self._processor = 0.0
        self._latencies = np.zeros(round(MAX_LATENCY_S / BIN_S), np.int64)
        self._errors = 0
        self._square_error = self._worst = 0.0
        self._contact: dict[str, float] = {}
        self._touched = self._deepest = self._doubtful = 0.0
        self._memory_first = 0.0
        self._state = LiveState()
        self._provenance: Provenance | None = None

    def take(
        self,
        height: Height,
        end: float,
        state: LiveState,
        truth: Height | None,
        provenance: Provenance | None = None,
        contact: dict[str, float] | None = None,
    ) -> None:
        """Count one height that has just been computed."""
        now = time.monotonic()
        self._state, self._provenance = state, provenance
        if now - self._start < WARM_UP_S:
            return
        if not self._heights:
            self._first = self._reported_s = now
            self._processor = time.process_time()
            self._memory_first = resident_mib()
        self._last = now
        self._heights += 1
        self._latencies[min(int((now - end) / BIN_S), len(self._latencies) - 1)] += 1
        if truth is not None:
            rmse = float(np.sqrt(np.mean(np.square(height - truth))))
            self._errors += 1
            self._square_error += rmse * rmse
            self._worst = max(self._worst, rmse)
        self._contact = contact or {}
        depths = _of_all(self._contact, "contact_depth_mm")
        self._touched += bool(depths)
        self._deepest = max(self._deepest, *depths, 0.0)
        self._doubtful += self._contact.get("trust", 1.0) < MIN_TRUST
        if now - self._reported_s >= self._every:
            self._tell(now)

    def figures(self) -> dict[str, float]:
        """The figures so far, from `WARM_UP_S` after the start."""
        figures: dict[str, float] = {"heights": float(self._heights)}
        if self._heights > 1:
            figures["heights_per_s"] = (self._heights - 1) / (self._last - self._first)
            used = time.process_time() - self._processor
            figures["processor_ms_per_height"] = 1e3 * used / (self._heights - 1)
            figures["latency_median_ms"] = 1e3 * self._latency(0.5)
            figures["latency_99_percent_ms"] = 1e3 * self._latency(0.99)
        if self._errors:
            figures["rmse_um"] = 1e3 * float(np.sqrt(self._square_error / self._errors))
            figures["worst_rmse_um"] = 1e3 * self._worst
        if self._contact:
            figures["touched_percent"] = 100 * self._touched / self._heights
            figures["deepest_contact_mm"] = self._deepest
            figures["doubtful_percent"] = 100 * self._doubtful / self._heights
        figures["frames"] = float(self._state.frames)
        figures["dropped"] = float(self._state.dropped)
        for fault, times in sorted(self._state.faults.items()):
            figures[f"faults/{fault}"] = float(times)
        figures["memory_mib"] = resident_mib()
        figures["memory_growth_mib"] = resident_mib() - self._memory_first
        return figures

    def close(self) -> None:
        """Write the summary to the terminal and to ``result.json``."""
        figures = self.figures()
        width = max(map(len, figures))
        for name, figure in figures.items():
            print(f"  {name:<{width}}  {figure:.6g}")
        sys.stdout.flush()
        if self._folder is not None:
            about = self._provenance.as_dict() if self._provenance is not None else {}
            summary = {**about, "settings": self._state.settings, "metrics": figures}
            with atomic_files(self._folder) as target:
                (target / "result.json").write_text(json.dumps(summary, indent=1) + "\n")

    def _latency(self, quantile: float) -> float:
        """The upper edge of the bin in which the quantile lies."""
        reached = np.cumsum(self._latencies)
        return float(np.searchsorted(reached, quantile * reached[-1]) + 1) * BIN_S

    def _tell(self, now: float) -> None:
        rate = (self._heights - self._heights_reported) / (now - self._reported_s)
        self._heights_reported, self._reported_s = self._heights, now
        figures = self.figures()
        parts = [f"{rate:5.1f} heights/s", f"latency {figures.get('latency_median_ms', 0):.1f} ms"]
        if "rmse_um" in figures:
            parts.append(f"rmse {figures['rmse_um']:.1f} um")
        if depths := _of_all(self._contact, "contact_depth_mm"):
            count = int(self._contact["contacts"])
            parts.append(f"{count} contact{'s' * (count > 1)}, {max(depths):.2f} mm deep")
        if forces := _of_all(self._contact, "contact_force_n"):
            parts.append(f"{sum(forces):.2f} N")
        if self._contact.get("trust", 1.0) < MIN_TRUST:
            parts.append(f"doubtful (trust {self._contact['trust']:.2g})")
        faults = sum(self._state.faults.values())
        parts += [f"{self._state.dropped} dropped", f"{faults} faults"]
        parts.append(f"{figures['memory_mib']:.0f} MiB")
        print(", ".join(parts), flush=True)


def _of_all(figures: dict[str, float], name: str) -> list[float]:
    """The values of one figure for all contacts."""
    return [figure for key, figure in figures.items() if key.startswith(f"{name}/")]


def resident_mib() -> float:
    """Memory of this process in MiB; its peak if only that is known."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except (OSError, ValueError, IndexError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return pages * resource.getpagesize() / 2**20
