"""A graph that is ready to run: call it with arrays, or iterate over its items.

Long because this class is the whole interface of a running graph.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tactograph.graph.backends.device_backend import DeviceBackend, open_device
from tactograph.graph.cache.cache import Cache
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.errors import InputError, TactographError, collect_warnings
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.plan.draft import Task
from tactograph.graph.plan.make_plan import make_plan
from tactograph.graph.plan.names import settings_of
from tactograph.graph.plan.new_settings import with_parameters, with_values
from tactograph.graph.plan.plan import Plan
from tactograph.graph.plan.sketch import plan_svg
from tactograph.graph.run.items import Items
from tactograph.graph.run.keep_freed import give_back, keep_freed
from tactograph.graph.run.node_errors import Blaming
from tactograph.graph.run.one_thread import Turn
from tactograph.graph.run.ownership import own
from tactograph.graph.run.raise_warnings import raise_warnings
from tactograph.graph.run.result import Result
from tactograph.graph.run.source_stream import SourceStream, in_thread
from tactograph.graph.run.stand_ins import HandedIn, StandIns


class Pipeline:
    """A verified, planned and compiled graph that keeps its buffers from call to call.

    One thread at a time may use it; a second one is refused.  Closing it, or leaving its ``with``
    block, ends the stream and closes the nodes' sessions.  `closing_warnings` are the warnings
    after the last item, or of an item that failed.  A copy, or a pipeline unpickled in another
    process, is loaded again by `anew`, with the present settings and an empty cache.
    """

    def __init__(
        self,
        plan: Plan,
        device: DeviceBackend | None,
        cache: Cache | None = None,
        anew: Callable[[Graph, Mapping[str, Any]], Self] | None = None,
    ) -> None:
        keep_freed()
        self.plan = plan
        self._anew = anew
        self.closing_warnings: list[str] = []
        self._device = device
        self._turn = Turn(plan.graph.name, on_device=device is not None)
        self._stand_ins = StandIns(plan, device)
        self._items = Items(plan, device)
        self._runner = self._items.runner
        if cache is not None:
            self._items.keep(cache)
        self._has_run = False
        self._raised: set[str] = set()
        tasks = plan.tasks.values()
        self._source = next((t for t in tasks if t.node.stream and not t.stand_in), None)
        self._stream: SourceStream | None = None
        self._running: object | None = None

    @staticmethod
    def verify(graph: Graph) -> Plan:
        """Plan a graph without values for its params, as `tactograph check` does.

        Raises
        ------
        GraphError
            If the graph cannot run; `others` are further errors.
        """
        bound = [entry.backend for entry in graph.nodes.values() if entry.backend is not None]
        device, reason = open_device(bound)
        # Placement does not matter here, so no device need be loaded.
        anywhere = replace(graph, prefer=("numpy",))
        plan = partial(make_plan, anywhere, graph.placeholders, device=device, no_device=reason)
        runs = plan()
        if runs.unused:  # a run leaves these nodes out, but they may be wrong, too
            nodes = {name: find_node(graph.nodes[name].op, graph.own) for name in runs.unused}
            unread = {name: f"{name}.{next(iter(node.outputs))}" for name, node in nodes.items()}
            plan(outputs={**graph.outputs, **unread})
        return runs

    @staticmethod
    def settings(graph: Graph, node: str, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Return a node's parameters, defaults included, for these values of the graph's params.

        Raises
        ------
        InputError
            If there is no such node, if it does not accept a value, or if a param is missing.
        """
        entry = graph.entry(node)
        return settings_of(entry, graph, find_node(entry.op, graph.own), arguments)

    def __reduce__(self) -> tuple[Any, ...]:
        if self._anew is None:
            raise InputError(f"{self.plan.graph.name}: cannot be copied; load the graph again")
        return self._anew, (self.plan.graph, dict(self.plan.arguments))

    def __call__(self, /, **stand_ins: NDArray[Any]) -> Result:
        """Run one item on arrays that stand in for source nodes, and return its outputs.

        The caller may refill the arrays afterwards: neither result nor pipeline refers to them.

        Parameters
        ----------
        **stand_ins
            By source node: an array with the shape and the unit of its first output, such as a
            height H x W in mm, or a K x H x W stack of images.  Images of unsigned integers are
            fractions of their full scale; floats have to lie within 0..1.  Any object on the host
            with ``__array__`` or ``__dlpack__`` is accepted, and a ``pyopencl.array.Array`` of the
            context of `queue`, which the device reads in place.

        Warns
        -----
        UserWarning
            Once per pipeline for each kind of warning in the result.

        Raises
        ------
        InputError
            If an array is missing or does not fit its source, if sizes clash, if the pipeline was
            closed, or if another thread is using it.
        """
        self._refuse_own_stream()
        return self._call(self._stand_ins.check(stand_ins))

    def stream(self, items: Iterable[Any]) -> Iterator[Result]:
        """Call the pipeline on each item of an iterable, in order.

        A thread reads the next item while the last one is computed; an error of the iterable is
        raised in the place of its item.

        Parameters
        ----------
        items
            Yields arrays, which it may refill, or mappings of arrays if several sources wait.
        """
        self._refuse_own_stream()
        for handed_in in in_thread(map(self._stand_ins.owned, items)):
            yield self._call(handed_in)

    def _refuse_own_stream(self) -> None:
        if self._source is not None:
            raise InputError(
                f"{self.plan.graph.name}: '{self._source.id}' yields the items itself; iterate "
                "over items()"
            )

    def _call(self, handed_in: HandedIn) -> Result:
        with self._turn:
            self._items.prepare()
            arrays, on_device = self._stand_ins.split(handed_in.arrays)
            if self._items.keeps:  # what is kept must not change with the caller's arrays
                arrays, on_device = {name: own(array) for name, array in arrays.items()}, {}
            self._items.begin()
            self._runner.notes += handed_in.warnings
            self._has_run = False
            try:
                result = self._items.item(self._stand_ins.item(arrays), there=on_device)
            finally:
                raise_warnings(self._runner.notes, self._raised)
            # An array that a node passed on is still the caller's memory.
            for name, value in result.outputs.items():
                if isinstance(value, np.ndarray):
                    shares = any(np.may_share_memory(value, array) for array in arrays.values())
                    result.outputs[name] = own(value) if shares else value
            result.item = {}
            self._has_run = True
            return result

    def items(self, repeats: int = 1, stream: SourceStream | None = None) -> Iterator[Result]:
        """Run every item of the graph's stream, sinks included.

        The stream ends with its source, or when a sink raises `EndOfStream`; it can be run again.

        Parameters
        ----------
        repeats
            How often each item is computed; sinks run once.  Times are medians over all runs but
            the first, which compiles kernels and fills caches.
        stream
            A stream that `begin` returned for the pipeline's present values.

        Raises
        ------
        InputError
            If the pipeline was closed, if its stream is being iterated over, or if another thread
            is using it.
        """
        if self._stand_ins.names:
            waiting = ", ".join(self._stand_ins.names)
            raise InputError(f"{self.plan.graph.name}: call the pipeline with arrays for {waiting}")
        with self._turn:
            if self._running is not None:
                raise InputError(
                    f"{self.plan.graph.name}: the stream is being iterated over already; end that "
                    "first, or load the graph again"
                )
            mine = self._running = object()
            self.closing_warnings = []
        try:
            with self._turn:
                self._items.forget()
                self._items.prepare()
            if self._source is None:
                with self._turn:
                    result = self._items.item({}, repeats)
                    self._has_run = True
                yield result
            else:
                yield from self._all_items(self._source, repeats, mine, stream)
        except TactographError:
            self.closing_warnings += self._runner.notes
            raise
        finally:
            if self._running is mine:
                self._end()

    def _all_items(
        self, source: Task, repeats: int, mine: object, ready: SourceStream | None
    ) -> Iterator[Result]:
        self._rehearse(source)
        self._items.ended = False
        with collect_warnings(self._runner.notes):
            stream = ready or self._open(source, source.settings, ahead=repeats == 1)
        self._stream = stream
        while not self._items.ended and self._running is mine:
            with self._turn:
                self._items.begin()
                with collect_warnings(self._runner.notes):
                    item = stream.next()
                if item is None:
                    self.closing_warnings += self._items.new_warnings
                    return
                self._runner.times[source.id] = stream.milliseconds
                self._has_run = False
                try:
                    result = self._items.item({source.id: item}, repeats)
                except TactographError as error:
                    error.at_item(source.node.name_of(item))
                    raise
                self._has_run = True
            yield result

    def _rehearse(self, source: Task) -> None:
        """Run the source's dummy item before it starts, unless a node's session would keep it."""
        make = source.node.make_rehearsal
        others = (t for t in self.plan.tasks.values() if t.stream and not t.node.sink)
        if make is None or any(t.node.session for t in others if t is not source):
            return
        with self._turn, Blaming(self.plan, source):
            item = make(**source.settings, **self._runner.host.integer_keyword(source))
        with self._turn:
            self._items.rehearse({source.id: item})

    def begin(self, /, **values: Any) -> SourceStream | None:
        """Begin the stream that the pipeline will have after `aim` with these values.

        Another thread may call it while this pipeline works.  Returns None if the source has a
        session.  Raises InputError if a value is not of its param's kind.
        """
        source = self._source
        if source is None or source.node.session is not None:
            return None
        arguments = {**self.plan.arguments, **values}
        return self._open(source, self.settings(self.plan.graph, source.id, arguments))

    def _open(self, source: Task, settings: dict[str, Any], *, ahead: bool = True) -> SourceStream:
        host = self._runner.host
        keywords = {**settings, **host.integer_keyword(source), **host.session(source)}
        return SourceStream(self.plan, source, keywords, ahead=ahead)

    def set(self, node: str, /, **settings: Any) -> None:
        """Change parameters of a node for the following items.

        From then on the pipeline caches the results of its nodes, up to 512 MB (see `Cache`),
        and computes only what a change affects.

        Parameters
        ----------
        node
            Its name in the graph, the name of a group's use, or ``group.node`` for every use.
        **settings
            Its parameters, as in ``with`` of a graph file.

        Raises
        ------
        InputError
            If there is no such node or parameter, or if it does not accept the value.  Nothing has
            changed then.

        Examples
        --------
        >>> pipeline.set("shadow", threshold=4)  # doctest: +SKIP
        """
        new = with_parameters(self.plan, node, settings)
        with self._turn:
            new.apply(self.plan)
            self._keep()
            self._items.settings_changed(new.settings)

    def again(self, outputs: Collection[str] | None = None) -> Result:
        """Run the last item once more, with the settings of now and the source values of then.

        Only what changed is computed.  Sinks write again.

        Parameters
        ----------
        outputs
            Names of the only outputs to compute; sinks are then left out.

        Raises
        ------
        InputError
            If no item has cached results yet: load with ``cache=Cache()``, or call `set` first.
        """
        with self._turn:
            self._keep()
            self._refuse_without_item("again")
            self._items.prepare()
            return self._items.again(outputs)

    def inspect(self, reference: str) -> Any:
        """A value from inside the graph, of the last item: ``"label.misfit"``.

        Parameters
        ----------
        reference
            ``node.port``, or ``node`` if that has one output.

        Returns
        -------
        The value; an array is read-only.  None if it is absent from the item.

        Raises
        ------
        InputError
            If there is no such value, or if no item has cached results yet.
        """
        value = self.plan.value(reference)
        with self._turn:
            self._keep()
            self._refuse_without_item(f"inspect {reference}")
            return self._items.inspect(value)

    def _keep(self) -> None:
        """Cache the results of the following items."""
        if not self._items.keeps:
            self._items.keep(Cache())
            self._has_run = False

    def _refuse_without_item(self, method: str) -> None:
        if not self._has_run:
            why = "no item has cached results; run one now, or load with cache=Cache()"
            raise InputError(f"{self.plan.graph.name}: {method}: {why}")

    def _repr_svg_(self) -> str:
        return plan_svg(self.plan, self._runner.times)

    @property
    def buffers(self) -> int:
        """The number of buffers allocated on the device so far; a steady stream adds none."""
        return self._device.buffers if self._device is not None else 0

    @property
    def queue(self) -> Any:
        """The device's queue, for arrays that a caller makes there and hands in; or None."""
        return self._device and self._device.queue

    @property
    def stage(self) -> str:
        """The step that runs now, for another thread to show; "" between items."""
        return self._runner.stage_in_words

    @property
    def endless(self) -> bool:
        """Whether the stream ends only when it is stopped."""
        return any(task.node.endless for task in self.plan.tasks.values())

    def aim(self, /, **values: Any) -> None:
        """Change values of the graph's params that only nodes of the stream take.

        So a pipeline continues with another capture under the same calibration, plan and kernels.

        Raises
        ------
        InputError
            If the graph has no such param, or if a node outside the stream depends on it.
        """
        new = with_values(self.plan, values)
        with self._turn:
            new.apply(self.plan)
            self._items.settings_changed(new.settings)

    def forget(self) -> None:
        """Treat the next item as the first: it has no previous values."""
        with self._turn:
            self._items.forget()

    def close(self) -> None:
        """End the stream and close the nodes' sessions; the pipeline cannot be used again.

        Raises
        ------
        InputError
            If another thread is using it.
        """
        if self._turn.end():
            self._end()
            give_back()

    def _end(self) -> None:
        """End the stream and close the nodes' sessions."""
        running, self._stream, self._running = self._stream, None, None
        with collect_warnings(self.closing_warnings), ExitStack() as stack:
            stack.callback(self._items.end)
            if running is not None:
                stack.callback(running.close)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
