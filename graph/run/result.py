"""What one item of a run gave."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tactograph.graph.plan.draft import Value
from tactograph.graph.plan.plan import Plan
from tactograph.graph.show.notebook import result_html


@dataclass(eq=False, repr=False)
class Result(Mapping[str, Any]):
    """What one item gave: the graph's outputs by name, and how long each step took.

    Arrays are read-only: the pipeline may still hold them, for the next item or for all.
    `times` is in milliseconds, by step.  `item` is what the stream's source yielded; `total`
    the milliseconds from there to the last output, as a clock on the wall sees them.
    `kept` are the steps whose results were there already; their times are those of back then.
    """

    outputs: dict[str, Any]
    times: dict[str, float]
    plan: Plan
    warnings: list[str] = field(default_factory=list)
    item: dict[Value, Any] = field(default_factory=dict)
    total: float = 0.0
    kept: frozenset[str] = frozenset()

    def __getitem__(self, name: str) -> Any:
        if name not in self.outputs:
            raise KeyError(f"no output {name!r}; there are {', '.join(self.outputs) or 'none'}")
        return self.outputs[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.outputs)

    def __len__(self) -> int:
        return len(self.outputs)

    def __repr__(self) -> str:
        names = (
            f"{name}: {value.dtype} {' x '.join(map(str, value.shape))}"
            if isinstance(value, np.ndarray)
            else f"{name}: {value!r}"
            for name, value in self.outputs.items()
        )
        return f"Result({', '.join(names)})"

    def _repr_html_(self) -> str:
        plan = self.plan
        ports = {name: plan.port(name) for name in self.outputs}
        return result_html(plan.graph.title or plan.graph.name, self.outputs, ports, self.total)
