"""Make the provenance that a sink gets: a description of the run so far."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tactograph.graph.declare.provenance import Provenance, versions
from tactograph.graph.disk.file_identity import identities
from tactograph.graph.plan.plan import Plan, Step
from tactograph.graph.plan.sizes import Bounds


def make_provenance(
    plan: Plan, times: Mapping[str, float], bounds: Bounds, warnings: list[str]
) -> Provenance:
    """Describe the run so far, for a sink that writes it."""
    arguments = {n: plan.arguments.get(n, p.default) for n, p in plan.graph.params.items()}
    paths = [n for n, p in plan.graph.params.items() if p.kind == "path"]
    sizes: dict[str, int] = {}
    for (_, symbol), bound in bounds.items():
        sizes.setdefault(symbol, bound.size)
    return Provenance(
        graph={"name": plan.graph.name, "title": plan.graph.title, "hash": plan.graph.hash},
        device=plan.device,
        nodes=[_timed(plan, step, times) for step in plan.steps if step.name in times],
        sizes=sizes,
        versions=versions(),
        warnings=list(warnings),
        fallbacks=plan.fallbacks,
        arguments={n: str(v) if isinstance(v, Path) else v for n, v in arguments.items()},
        inputs=identities({name: arguments[name] for name in paths}),
    )


def _timed(plan: Plan, step: Step, times: Mapping[str, float]) -> dict[str, Any]:
    task = plan.tasks.get(step.name)
    return {
        "node": step.name,
        "op": task.node.name if task else step.kind,
        "backend": step.backend,
        "once": not step.stream,
        "ms": round(times[step.name], 4),
        "why": step.why,
    }
