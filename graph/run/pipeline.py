"""A graph that is ready to run: called with arrays, or gone through item by item.

Long because this class is all that a program sees of a running graph.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import replace
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

    A pipeline belongs to one thread; a second thread at the same time is refused.  Closing it, or
    leaving its ``with`` block, ends the stream for good and closes the nodes' sessions.
    `closing_warnings` came after the last item, or of one that failed.  A copy, or one unpickled in
    another process, is loaded anew by `anew`, with the settings as they are and nothing kept.
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
        """Plan a graph for no data in particular, as `tactograph check` does.

        Raises
        ------
        GraphError
            If it cannot be run; `others` are further errors that were found with this one.
        """
        bound = [entry.backend for entry in graph.nodes.values() if entry.backend is not None]
        device, reason = open_device(bound)
        # Where nodes run does not matter here, so that no device need be loaded.
        anywhere = replace(graph, prefer=("numpy",))
        return make_plan(anywhere, graph.placeholders, device=device, no_device=reason)

    @staticmethod
    def settings(graph: Graph, node: str, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Return a node's parameters by a graph and values of its params, defaults included.

        Raises
        ------
        InputError
            If there is no such node, it does not take a value, or a param that it needs has none.
        """
        entry = graph.entry(node)
        return settings_of(entry, graph, find_node(entry.op, graph.own), arguments)

    def __reduce__(self) -> tuple[Any, ...]:
        if self._anew is None:
            raise InputError(f"{self.plan.graph.name}: load the graph again where it is needed")
        return self._anew, (self.plan.graph, dict(self.plan.arguments))

    def __call__(self, /, **stand_ins: NDArray[Any]) -> Result:
        """Run one item on arrays that stand in for source nodes, and return its outputs.

        The arrays may be refilled afterwards: neither the result nor the pipeline holds them.

        Parameters
        ----------
        **stand_ins
            By source node: an array of the sizes and the unit of its first output, such as a
            height H x W in mm, or a K x H x W stack of images.  Images of unsigned integers count
            as fractions of their full scale; floats have to lie within 0..1.  An object that has
            ``__array__`` or ``__dlpack__``, and lies on the host, counts as an array, and so does
            a ``pyopencl.array.Array`` of the context of `queue`; the device reads it in place.

        Warns
        -----
        UserWarning
            For each kind of warning in the result, once per pipeline.

        Raises
        ------
        InputError
            If a source is missing, an array does not fit its source, sizes clash, the pipeline was
            closed, or another thread is using it.
        """
        self._refuse_own_stream()
        return self._call(self._stand_ins.check(stand_ins))

    def stream(self, items: Iterable[Any]) -> Iterator[Result]:
        """Run what an iterable yields, item by item and in order, as calls would.

        A thread reads the next item while the last one is computed; its errors wait their turn.

        Parameters
        ----------
        items
            Yields arrays, which it may refill, or mappings of arrays where several sources wait.
        """
        self._refuse_own_stream()
        for handed_in in in_thread(map(self._stand_ins.owned, items)):
            yield self._call(handed_in)

    def _call(self, handed_in: HandedIn) -> Result:
        with self._turn:
            self._items.prepare()
            return self._on_arrays(handed_in)

    def _refuse_own_stream(self) -> None:
        if self._source is not None:
            raise InputError(
                f"{self.plan.graph.name}: '{self._source.id}' yields a stream of its own; "
                "go through items()"
            )

    def _on_arrays(self, handed_in: HandedIn) -> Result:
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
        # An array that a node passed on is still the caller's own memory.
        for name, value in result.outputs.items():
            if isinstance(value, np.ndarray):
                shares = any(np.may_share_memory(value, array) for array in arrays.values())
                result.outputs[name] = own(value) if shares else value
        result.item = {}
        self._has_run = True
        return result

    def items(self, repeats: int = 1, stream: SourceStream | None = None) -> Iterator[Result]:
        """Run every item of the graph's stream, sinks included.

        The stream ends with its source, or where a sink raised `EndOfStream`; it can be run again.

        Parameters
        ----------
        repeats
            Number of times that each item is computed; sinks run once.  Times are medians over
            all runs but the first, which compiles and fills caches.
        stream
            The stream that `begin` began for the values that the pipeline has now.

        Raises
        ------
        InputError
            If the pipeline was closed, goes through its stream already, or another thread uses it.
        """
        if self._stand_ins.names:
            waiting = ", ".join(self._stand_ins.names)
            raise InputError(f"{self.plan.graph.name}: call the pipeline with arrays for {waiting}")
        with self._turn:
            if self._running is not None:
                raise InputError(
                    f"{self.plan.graph.name}: the pipeline is going through its stream already; "
                    "end that first, or load the graph once more"
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
        self, source: Task, repeats: int, mine: object, begun: SourceStream | None
    ) -> Iterator[Result]:
        self._rehearse(source)
        self._items.ended = False
        with collect_warnings(self._runner.notes):
            stream = begun or self._begun(source, source.settings, ahead=repeats == 1)
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
        """Run a dummy item before the source starts, if it makes one and no node would keep it."""
        make = source.node.make_rehearsal
        others = (t for t in self.plan.tasks.values() if t.stream and not t.node.sink)
        if make is None or any(t.node.session for t in others if t is not source):
            return
        with self._turn, Blaming(self.plan, source):
            item = make(**source.settings, **self._runner.host.whole_images(source))
        with self._turn:
            self._items.rehearse({source.id: item})

    def begin(self, /, **values: Any) -> SourceStream | None:
        """Begin the stream that the pipeline has after `aim` with the same values.

        Another thread may do so while this pipeline works.  None if the source has a session.
        Raises InputError if a value is not of its param's kind.
        """
        source = self._source
        if source is None or source.node.session is not None:
            return None
        arguments = {**self.plan.arguments, **values}
        return self._begun(source, self.settings(self.plan.graph, source.id, arguments))

    def _begun(self, source: Task, settings: dict[str, Any], *, ahead: bool = True) -> SourceStream:
        keywords = {**settings, **self._runner.host.source_keywords(source)}
        return SourceStream(self.plan, source, keywords, ahead=ahead)

    def set(self, node: str, /, **settings: Any) -> None:
        """Change parameters of a node, for the items to come.

        From then on the pipeline keeps the results of its nodes, up to 512 MB (see `Cache`),
        and computes only what a change affects.

        Parameters
        ----------
        node
            Its name in the graph; also a use of a group, or ``group.node`` for every use.
        **settings
            Its parameters, as ``with`` of a graph file gives them.

        Raises
        ------
        InputError
            If there is no such node or parameter, or it does not take the value; then nothing
            has changed.

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
        """Run the last item once more: settings as they are now, its sources as they were.

        Only what changed is computed.  Sinks write again.

        Parameters
        ----------
        outputs
            The graph's outputs that are wanted this time; sinks are then left out.

        Raises
        ------
        InputError
            If no item has kept results yet (``load(…, cache=Cache())``, or after the first
            `set`).
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
        An array is read-only.  None: the item has no such value.

        Raises
        ------
        InputError
            If there is no such value, or no item has kept results yet.
        """
        value = self.plan.value(reference)
        with self._turn:
            self._keep()
            self._refuse_without_item(f"inspect {reference}")
            return self._items.inspect(value)

    def _keep(self) -> None:
        """Keep the results of the items to come."""
        if not self._items.keeps:
            self._items.keep(Cache())
            self._has_run = False

    def _refuse_without_item(self, method: str) -> None:
        if not self._has_run:
            why = "no item has run since results are kept; run one now, or load with cache=Cache()"
            raise InputError(f"{self.plan.graph.name}: {method}: {why}")

    def _repr_svg_(self) -> str:
        return plan_svg(self.plan, self._runner.times)

    @property
    def buffers(self) -> int:
        """The number of buffers ever allocated on the device; a steady stream adds none."""
        return self._device.buffers if self._device is not None else 0

    @property
    def queue(self) -> Any:
        """The device's queue, by which arrays are made that are handed in there; or None."""
        return self._device and self._device.queue

    @property
    def stage(self) -> str:
        """The step that runs now, for another thread to show; "" between items."""
        return self._runner.stage_in_words

    @property
    def endless(self) -> bool:
        """Whether the stream only ends when it is stopped."""
        return any(task.node.endless for task in self.plan.tasks.values())

    def aim(self, /, **values: Any) -> None:
        """Give other values to params of the graph that only the stream's nodes take.

        A pipeline can so go on to another capture with the same calibration, plan and kernels.

        Raises
        ------
        InputError
            If the graph has no such param, or a node outside the stream depends on it.
        """
        new = with_values(self.plan, values)
        with self._turn:
            new.apply(self.plan)
            self._items.settings_changed(new.settings)

    def forget(self) -> None:
        """Let the next item be a first one: nothing came before it."""
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
