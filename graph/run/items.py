"""Run a plan item by item; nodes that do not depend on the stream run once."""

import sys
from collections.abc import Collection, Iterable, Mapping
from functools import lru_cache
from typing import Any

from threadpoolctl import ThreadpoolController

from tactograph.graph.backends.arrays import DeviceArray
from tactograph.graph.backends.device_backend import DeviceBackend
from tactograph.graph.cache.cache import Cache
from tactograph.graph.errors import EndOfStream, collect_warnings
from tactograph.graph.plan.draft import Value
from tactograph.graph.plan.plan import Plan
from tactograph.graph.run.executor import Executor, Outputs, Part, Yields, part_of
from tactograph.graph.run.incremental import OnlyChanged
from tactograph.graph.run.result import Result
from tactograph.graph.run.step_runner import StepRunner


class Items:
    """Runs items: an executor computes each, the sinks write it, and a `Result` returns it.

    `runner` has the values, times and warnings of the present item; `ended` is true once a sink
    wants no further item.
    """

    def __init__(self, plan: Plan, device: DeviceBackend | None) -> None:
        self._plan = plan
        self.runner = StepRunner(plan, device)
        self.ended = False
        self._every = Executor(self.runner)
        self._only_changed: OnlyChanged | None = None
        self._once, self._stream = part_of(plan, stream=False), part_of(plan, stream=True)
        self._is_prepared = False
        self._lasting = 0
        self._libraries = _libraries(len(sys.modules))

    @property
    def _executor(self) -> Executor:
        return self._only_changed or self._every

    @property
    def keeps(self) -> bool:
        """Return whether results are cached, so that the last item can be run again."""
        return self._only_changed is not None

    def keep(self, cache: Cache) -> None:
        """From now on, run only nodes whose results are not in the cache."""
        self._only_changed = OnlyChanged(self.runner, cache)
        self._is_prepared = False
        self._lasting = 0

    def prepare(self) -> None:
        """Run the nodes that do not depend on the stream, once."""
        if self._is_prepared:
            return
        self.begin()
        if self._only_changed is not None:
            self._only_changed.begin(same_item=True)
        self._run(self._once, {}, 1, self._plan.outputs)
        if not self.keeps:
            self._lasting = len(self.runner.notes)
        self._is_prepared = True

    def begin(self) -> None:
        """Forget the previous item's warnings; keep those of nodes that ran once."""
        del self.runner.notes[self._lasting :]

    @property
    def new_warnings(self) -> list[str]:
        """The warnings since `begin`."""
        return self.runner.notes[self._lasting :]

    def item(
        self,
        yields: Yields,
        repeats: int = 1,
        there: Mapping[Value, DeviceArray] | None = None,
    ) -> Result:
        """Run one item of the stream; see `Pipeline.items`.

        `yields` are the values of its source, and `there` those that lie on the device as well.
        Both belong to the caller again afterwards.
        """
        device, host = self.runner.device, self.runner.host
        if device is not None:
            device.caller_arrays = there or {}
        try:
            return self._item(self._stream, yields, repeats, self._plan.outputs, same_item=False)
        finally:
            for value in there or {}:
                host.put(value, None)

    def again(self, names: Collection[str] | None = None) -> Result:
        """Run the last item once more, with the settings of now and the source values of then.

        With `names` only those outputs are computed, and sinks are left out.
        """
        part, outputs = self._stream, self._plan.outputs
        if names is not None:
            part = part._replace(sinks=[])
            outputs = {name: value for name, value in outputs.items() if name in names}
        return self._item(part, {}, 1, outputs, same_item=True)

    def inspect(self, value: Value) -> Any:
        """A value of the last item, computed again if it was dropped."""
        assert self._only_changed is not None
        return self._only_changed.inspect(value)

    def rehearse(self, yields: Yields) -> None:
        """Compute an item and discard it: this compiles kernels and fills caches."""
        if self.keeps:
            return  # the dummy item's results would be kept
        self.begin()
        with collect_warnings([]):
            self._every.compute(self._stream, yields, self._plan.outputs, 1)
        self.runner.stage = ""
        self.forget()

    def forget(self) -> None:
        """Treat the next item as the first: it has no previous values."""
        self._executor.forget()

    def settings_changed(self, nodes: Iterable[str]) -> None:
        """Recompute everything that may depend on the settings of these nodes."""
        for name in nodes:
            self.runner.settings_changed(name)
            self._executor.changed(name)
            if not self._plan.tasks[name].stream:
                self._is_prepared = False

    def end(self) -> None:
        """Close the sessions; a node outside the stream that had one will run again."""
        host = self.runner.host
        if any(not self._plan.tasks[name].stream for name in host.sessions):
            self._is_prepared = False
        host.close()

    def _item(
        self, part: Part, yields: Yields, repeats: int, outputs: Outputs, *, same_item: bool
    ) -> Result:
        executor, host = self._executor, self.runner.host
        before = len(self.runner.notes)
        executor.begin(same_item=same_item)
        total = self._run(part, yields, repeats, outputs)
        tasks = self._plan.tasks
        yielded = [Value(name, port) for name in yields for port in tasks[name].node.outputs]
        lent = self.runner.lent(outputs.values(), cached=self.keeps)
        result = Result(
            outputs={name: lent[value] for name, value in outputs.items()},
            times=dict(self.runner.times),
            plan=self._plan,
            warnings=list(self.runner.notes),
            item={value: host[value] for value in yielded},
            total=total,
            reused=executor.reused,
            shared_warnings=before,
        )
        executor.end()
        return result

    def _run(self, part: Part, yields: Yields, repeats: int, outputs: Outputs) -> float:
        """Compute a part, then run its sinks, which may write the times; return the total time."""
        # Nodes multiply small matrices.  OpenBLAS would share each among threads that wait for one
        # another, up to 50 times slower.
        one_thread = self._libraries.limit(limits=1, user_api="blas")
        with collect_warnings(self.runner.notes), one_thread:
            bounds, total = self._executor.compute(part, yields, outputs, repeats)
            for step in part.sinks:
                try:
                    bounds = self.runner.execute(step, bounds, yields)
                except EndOfStream:
                    # The other sinks still get this item.
                    self.ended = True
            self.runner.stage = ""
        return total


@lru_cache(maxsize=1)
def _libraries(modules: int) -> ThreadpoolController:
    """The loaded libraries that use threads; cached by the number of loaded `modules`.

    The search takes 50 ms, as long as a whole run of a sweep.
    """
    return ThreadpoolController()
