"""The result of one item."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from tactograph.graph.plan.draft import Value
from tactograph.graph.plan.plan import Plan
from tactograph.graph.plan.sketch import plan_svg
from tactograph.graph.show.notebook import result_html


@dataclass(eq=False, repr=False)
class Result(Mapping[str, Any]):
    """The outputs of one item by name.

    Arrays on the host are read-only, since the pipeline may still hold them.

    Attributes
    ----------
    times
        Milliseconds by step; for `reused` steps those of the last run.
    item
        The values that the stream's source yielded.
    total
        Milliseconds of wall time from the source to the last output.
    reused
        Steps that did not run, since their results were in the cache.
    shared_warnings
        Number of warnings, the first ones, that are not about the item: of nodes that ran once, and
        of the source, which names its files itself.
    """

    outputs: dict[str, Any]
    times: dict[str, float]
    plan: Plan
    warnings: list[str] = field(default_factory=list)
    item: dict[Value, Any] = field(default_factory=dict)
    total: float = 0.0
    reused: frozenset[str] = frozenset()
    shared_warnings: int = 0

    def svg(self, opened: Iterable[str] = ()) -> str:
        """The plan with its times as SVG; a group's use is one box unless it is in `opened`."""
        return plan_svg(self.plan, self.times, opened)

    @property
    def figures(self) -> dict[str, Any]:
        """All named figures among the outputs."""
        mappings = [value for value in self.outputs.values() if isinstance(value, dict)]
        return {name: figure for mapping in mappings for name, figure in mapping.items()}

    def __getitem__(self, name: str) -> Any:
        if name not in self.outputs:
            raise KeyError(f"no output {name!r}; it has {', '.join(self.outputs) or 'none'}")
        return self.outputs[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.outputs)

    def __len__(self) -> int:
        return len(self.outputs)

    def __repr__(self) -> str:
        names = (
            f"{name}: {value.dtype} {' x '.join(map(str, value.shape))}"
            if hasattr(value, "dtype")
            else f"{name}: {value!r}"
            for name, value in self.outputs.items()
        )
        return f"Result({', '.join(names)})"

    def _repr_html_(self) -> str:
        plan = self.plan
        ports = {name: plan.port(name) for name in self.outputs}
        on_host = {n: v.get() if hasattr(v, "map_to_host") else v for n, v in self.items()}
        return result_html(plan.graph.title or plan.graph.name, on_host, ports, self.total)
