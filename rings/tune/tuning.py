"""The state of a page: a graph under change, and its result on the present item.

Changes are taken at once, and one thread runs the latest state.  Requests in between are never
run, and outdated results are never shown.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from tactograph.rings.tune.runner import Runner, captures_of
from tactograph.rings.tune.variant import Change, changes_between, defaults_of, write_variant
from tactograph.rings.tune.watch import Stamp, files_of, stamp
from tactograph.sdk import Graph, InputError, Pipeline, Result, TactographError, nodes, read_graph

RATE_WINDOW_S = 1.0
REST_S = 0.12
"""Rest of the hand before figures and all else follow the output that is looked at."""


@dataclass(frozen=True)
class Request:
    """A request of the page."""

    graph: Graph
    capture: int
    item: int
    node: str | None
    revision: int = 0


@dataclass(frozen=True)
class State:
    """The last result with its request, and the error of a later request."""

    number: int = 0
    request: Request | None = None
    result: Result | None = None
    inspected: Mapping[str, Any] = field(default_factory=dict)
    error: str = ""


class Tuning:
    """A graph, by its name or path, that a user changes.

    The `output` that is looked at is made and shown first; figures and all else follow if no newer
    change waits.  With `every`, a change to a node of a group changes that node in every use.
    """

    def __init__(
        self,
        source: str,
        params: Mapping[str, Any],
        *,
        backend: str | None = None,
        device: str | None = None,
    ) -> None:
        self.source, self.params = source, dict(params)
        self.base = read_graph(source)
        self.captures = captures_of(self.base, params)
        self.request = Request(self.base, 0, 0, None)
        self.state = State()
        self.rates: deque[float] = deque()
        self.playing = False
        self.output: str | None = None
        self.every = False
        self._runner = Runner(params, backend, device)
        self._files = files_of(self.base)
        self._stamp: Stamp = stamp(self._files)
        self._saved: dict[Path, Stamp] = {}
        self._unreadable = ""
        self._changed = threading.Condition()
        self._ended = False
        self._last: Request | None = None
        Pipeline.verify(self.base)
        for name in self.base.nodes:  # all that it needs is given
            self.settings(name)
        self._thread = threading.Thread(target=self._work, name="tune", daemon=True)
        self._thread.start()

    @property
    def graph(self) -> Graph:
        return self.request.graph

    @property
    def capture(self) -> Path | None:
        return self.captures[self.request.capture] if self.captures else None

    def settings(self, node: str) -> dict[str, Any]:
        """A node's parameters as they are now, defaults included."""
        return Pipeline.settings(self.graph, node, self._own_params)

    def set(self, node: str, parameter: str, value: Any) -> None:
        """Change a parameter.

        Raises InputError if the node does not take the value; then nothing has changed.
        """
        nodes, changed = self.graph.nodes, {parameter: value}
        self._take(node, lambda name: {"settings": {**nodes[name].settings, **changed}})

    def set_backend(self, node: str, backend: str | None) -> None:
        """Bind a node to a back end; None restores that of the file.

        Raises InputError if there is no such back end.
        """
        entry = self.graph.entry(node)
        if backend == "opencl" and not getattr(nodes, entry.op).has_kernel:
            raise InputError(f"{node}: node '{entry.op}' has no OpenCL kernel")
        base = self.base.nodes
        self._take(node, lambda name: {"backend": backend or base[name].backend})

    def set_neutral(self, node: str, neutral: bool) -> None:
        """Take a node out, or put it back.  Raises InputError if it has no neutral value."""
        self._take(node, lambda _: {"neutral": neutral})

    def reset(self, node: str) -> None:
        """Reset a node to its settings in the file."""

        def as_read(name: str) -> dict[str, Any]:
            base = self.base.nodes[name]
            defaults = defaults_of(base.op)
            settings = {n: defaults[n] for n in self.graph.nodes[name].settings if n in defaults}
            return {**vars(base), "settings": {**settings, **base.settings}}

        self._take(node, as_read)

    def look_at(self, node: str | None) -> None:
        """Choose the node whose outputs are shown."""
        self._ask(node=node)

    def go(self, steps: int) -> None:
        """Go to the next capture or item, or, among captures, to one before."""
        with self._changed:  # a stream that plays goes on meanwhile
            if self.captures:
                self._ask(capture=(self.request.capture + steps) % len(self.captures))
            elif steps > 0:
                self._ask(item=self.request.item + 1)

    def play(self, on: bool) -> None:
        """Run a stream, or pause it."""
        with self._changed:
            self.playing = on and not self.captures
            self._changed.notify()

    def changes(self) -> list[Change]:
        """The patch that turns the graph in the file into the one on the screen."""
        return changes_between(self.base, self.graph)

    def save(self, file: Path) -> Path:
        """Write the variant and check it.

        Raises InputError if nothing was changed, or a file is there that was not saved here.
        """
        if file.resolve() in {read.resolve() for read in self._files}:
            raise InputError(f"{file}: is the graph that is tuned, or extended; give another name")
        if file.exists() and self._saved.get(file.resolve()) != stamp([file.resolve()]):
            raise InputError(f"{file}: is there already, and was not saved here; give another name")
        title = f"{self.base.title or self.base.name}, tuned"
        saved = write_variant(file, self.source, self.changes(), title)
        Pipeline.verify(saved)
        self._saved[file.resolve()] = stamp([file.resolve()])
        return file

    def reload(self) -> bool:
        """Read the graph again if its file changed; return whether it was.

        A file that cannot be read leaves the last good graph, and shows the error.
        """
        now = stamp(self._files)
        if now == self._stamp:
            return False
        self._stamp = now
        try:
            base = read_graph(self.source)
            Pipeline.verify(base)
        except TactographError as error:
            self._unreadable = " ".join(str(error).split())
            self._publish(self.state)
            return True
        self._unreadable = ""
        with self._changed:
            self.base = base
            self._files = files_of(base)
            self._stamp = stamp(self._files)
            node = self.request.node if self.request.node in base.nodes else None
            self._ask(graph=base, node=node, revision=self.request.revision + 1)
        return True

    def close(self) -> None:
        """End the thread, and close the pipelines."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join(timeout=30)

    @property
    def _own_params(self) -> dict[str, Any]:
        return {n: v for n, v in self.params.items() if n in self.graph.params}

    def _take(self, node: str, changed: Callable[[str], Mapping[str, Any]]) -> None:
        """Change a node, or, if `every`, that node in all uses of its group."""
        self.graph.entry(node)
        graph = self.graph
        names = graph.alike(node) if self.every else [node]
        for name in names:
            graph = graph.with_entry(name, replace(graph.nodes[name], **changed(name)))
        if any(graph.nodes[n].neutral != self.graph.nodes[n].neutral for n in names):
            Pipeline.verify(graph)
        else:  # quick enough for a slider
            for name in names:
                Pipeline.settings(graph, name, self._own_params)
        self._ask(graph=graph)

    def _ask(self, **changed: Any) -> None:
        """Request something else, which the thread then makes."""
        with self._changed:
            self.request = replace(self.request, **changed)
            self._changed.notify()

    def _work(self) -> None:
        last: Request | None = None
        while True:
            with self._changed:
                while not (self._ended or self.playing or self.request is not last):
                    self._changed.wait()
                if self._ended:
                    break
                if self.playing and self.request is last:
                    self.request = replace(self.request, item=self.request.item + 1)
                last = self.request
            self._run(last)
        self._runner.close()

    def _run(self, request: Request) -> None:
        capture = self.captures[request.capture] if self.captures else None
        try:
            is_quick = self._show_first(request, capture)
            if is_quick and not self._rests(request):
                return
            result = self._runner.run(request.graph, capture, request.item)
            inspected = self._inspect(request.node)
        except Exception as error:  # a bad edit must not take the page down
            self.playing = False
            kind = "" if isinstance(error, TactographError) else f"{type(error).__name__}: "
            message = kind + " ".join(str(error).split())
            self._publish(replace(self.state, request=request, error=message))
            return
        if not is_quick:
            self._count()
        self._publish(State(0, request, result, inspected))

    def _show_first(self, request: Request, capture: Path | None) -> bool:
        """Make and show the output that is looked at, if only settings changed."""
        last, before = self.state.request or self._last, self.state.result
        if self.output is None or last is None or before is None:
            return False
        place = (request.capture, request.item)
        if place != (last.capture, last.item) or self.output not in before:
            return False
        first = self._runner.run(request.graph, capture, request.item, [self.output])
        self._last = last
        merged = replace(first, outputs={**before.outputs, **first.outputs})
        self._count()
        self._publish(replace(self.state, request=None, result=merged, error=""))
        return True

    def _rests(self, request: Request) -> bool:
        """Return whether no newer request arrives within a moment."""
        with self._changed:
            newer = self._changed.wait_for(
                lambda: self._ended or self.request is not request, timeout=REST_S
            )
        return not newer

    def _count(self) -> None:
        now = time.monotonic()
        self.rates.append(now)
        while now - self.rates[0] > RATE_WINDOW_S:
            self.rates.popleft()

    def _inspect(self, node: str | None) -> dict[str, Any]:
        """The values of a node's outputs."""
        pipeline = self._runner.pipeline
        if node is None or pipeline is None or node not in pipeline.plan.tasks:
            return {}
        ports = pipeline.plan.tasks[node].node.outputs
        return {port: pipeline.inspect(f"{node}.{port}") for port in ports}

    def _publish(self, state: State) -> None:
        """Publish a result; the error of an unreadable file stays until it can be read."""
        error = self._unreadable or state.error
        self.state = replace(state, number=self.state.number + 1, error=error)
