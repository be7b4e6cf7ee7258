"""Pass 3: bind symbolic sizes across the graph.

A symbol (K, H, W) belongs to its node; an edge makes the symbols at its ends one class.
Fixed sizes are checked before anything runs, others as soon as the sources have yielded.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from tactograph.graph.declare.ports import IMAGE_SIZES, Dim
from tactograph.graph.declare.size_rules import SizeLimit
from tactograph.graph.errors import GraphError, InputError
from tactograph.graph.plan.draft import Draft, Task, Value

Symbol = tuple[str, str]
"""Node id and size symbol."""


class Bound(NamedTuple):
    """A size that is known, and the port that made it known."""

    size: int
    by: str


Known = dict[Symbol, Bound]
Shapes = dict[str, tuple[int, ...]]
"""Shapes by output port."""


@dataclass
class Sized:
    """The sizes around a node, valid for every item with the same `before`.

    `before` is compared by identity: the sizes behind a node are the same object from item to
    item as long as the node's outputs keep their shapes.  `doubtful` is set when the node's
    settings have changed, from which sizes may follow.
    """

    before: Known
    derived: Known
    sizes: dict[str, int]
    shapes: Shapes | None = None
    after: Known = field(default_factory=dict)
    doubtful: bool = False


@dataclass
class SizeClasses:
    """Classes of symbols that have the same size, with the nodes' limits on them."""

    root: dict[Symbol, Symbol]
    fixed: dict[Symbol, Bound]
    limits: dict[Symbol, list[tuple[str, SizeLimit]]]

    def around(self, task: Task, known: Known, last: Sized | None) -> Sized:
        """The sizes around a node; `last` if it follows from the same `known`.

        Raises InputError if a size that follows from others clashes with one that is known.
        """
        if last is not None and last.before is known and not last.doubtful:
            return last
        derived = dict(known)
        self.derive(derived, task)
        if last is not None and last.before is known and last.derived == derived:
            last.doubtful = False
            return last
        return Sized(known, derived, self.sizes_of(task, derived))

    def behind(self, task: Task, sized: Sized, shapes: Shapes) -> Known:
        """The sizes that are known behind a node with outputs of the given shapes.

        Raises InputError as `bind` does.
        """
        if sized.shapes is not shapes and sized.shapes != shapes:
            after = dict(sized.derived)
            for port, shape in shapes.items():
                self.bind(after, task, port, shape)
            sized.shapes, sized.after = shapes, after
        return sized.after

    def bind(self, known: Known, task: Task, port: str, shape: tuple[int, ...]) -> None:
        """Enter the shape of an output into `known`.

        Raises InputError if a size clashes with one that is known, naming both ports, or is one
        that a node does not accept, with that node's reason.
        """
        dims = task.node.outputs[port].dims
        for dim, size in zip(dims, shape, strict=True):
            if isinstance(dim, str):
                bound = Bound(size, _in_graph(task, port))
                self._bind_one(known, self.root[task.id, dim], dim, bound, dims)

    def derive(self, known: Known, task: Task) -> None:
        """Enter the sizes that follow from others, by a node's parameters, into `known`.

        Raises InputError if such a size clashes with one that is known.
        """
        sizes = self.sizes_of(task, known) if task.node.derived else {}
        for symbol, parts in task.node.derived.items():
            if sizes.keys() >= {*parts.of.split()}:
                bound = Bound(parts.size(sizes, task.settings), f"{task.id} ({parts})")
                self._bind_one(known, self.root[task.id, symbol], symbol, bound)

    def _bind_one(
        self, known: Known, root: Symbol, dim: str, bound: Bound, dims: tuple[Dim, ...] = ()
    ) -> None:
        other = known.get(root)
        if other is not None and other.size == bound.size:
            return
        other = other or self.fixed.get(root)
        if other is not None and other.size != bound.size:
            raise InputError(_clash_in_words(dim, dims, bound, other))
        for who, limit in self.limits.get(root, ()):
            if limit.refuses(bound.size):
                raise InputError(f"{who}: {dim} = {bound.size}: {limit.why}")
        known[root] = bound

    def sizes_of(self, task: Task, known: Mapping[Symbol, Bound]) -> dict[str, int]:
        """The known sizes of a node's symbols."""
        sizes: dict[str, int] = {}
        for symbol in task.node.symbols:
            root = self.root[task.id, symbol]
            bound = known.get(root) or self.fixed.get(root)
            if bound is not None:
                sizes[symbol] = bound.size
        return sizes


def _in_graph(task: Task, port: str) -> str:
    """A port, behind the graph's param that the node reads first."""
    settings = (s for s in task.entry.settings.values() if isinstance(s, str) and s[:1] == "$")
    param = None if task.stand_in else next(settings, None)
    return f"{task.id}.{port}" if param is None else f"{param[1:]}= ({task.id}.{port})"


def _clash_in_words(dim: str, dims: tuple[Dim, ...], one: Bound, other: Bound) -> str:
    """Describe two clashing sizes, those of images by what they count."""
    if dims[-2:] != ("H", "W") or dim not in IMAGE_SIZES:
        return (
            f"the size {dim} is {one.size} in {one.by} but {other.size} in {other.by}; they have "
            "to be the same"
        )
    return (
        f"{one.size} {IMAGE_SIZES[dim]} in {one.by}, but {other.size} in {other.by}: do both come "
        "from one sensor, neither cropped nor resized?"
    )


def unify(draft: Draft) -> SizeClasses:
    """Join the symbols at both ends of every edge.

    Raises GraphError if two fixed sizes meet, naming the two ports that disagree, or one that a
    node does not accept.
    """
    root: dict[Symbol, Symbol] = {
        (task.id, symbol): (task.id, symbol)
        for task in draft.tasks.values()
        for symbol in task.node.symbols
    }
    fixed: dict[Symbol, Bound] = {}
    for task, name, wanted, value, offered in _joints(draft, "reads"):
        _join(root, fixed, (task, name, wanted), (draft.tasks[value.node], value.port, offered))
    free = {_find(root, symbol) for symbol in _free_sizes(draft)}
    for task, name, wanted, value, offered in _joints(draft, "recalls"):
        # A size that depends on the data may differ from that of the item before.
        if isinstance(offered, int) or _find(root, (value.node, offered)) not in free:
            _join(root, fixed, (task, name, wanted), (draft.tasks[value.node], value.port, offered))
    flat = {symbol: _find(root, symbol) for symbol in root}
    limits: dict[Symbol, list[tuple[str, SizeLimit]]] = {}
    for task in draft.tasks.values():
        for symbol, limit in task.node.sizes.items():
            if not task.filled:
                limits.setdefault(flat[task.id, symbol], []).append((task.id, limit))
    for top, known in fixed.items():
        for who, limit in limits.get(flat[top], ()):
            if limit.refuses(known.size):
                where = draft.tasks[who].entry.where("in")
                raise GraphError(f"{where}: {known.by} has size {known.size}: {limit.why}")
    return SizeClasses(flat, fixed, limits)


def _joints(
    draft: Draft, edges: Literal["reads", "recalls"]
) -> Iterator[tuple[Task, str, Dim, Value, Dim]]:
    """The sizes at both ends of every array's edge: of the reader's input and of the value."""
    for task in draft.tasks.values():
        for name, value in getattr(task, edges).items():
            if task.node.inputs[name].kind == "array":
                offered = draft.tasks[value.node].node.outputs[value.port].dims
                for one, other in zip(task.node.inputs[name].dims, offered, strict=True):
                    yield task, name, one, value, other


def _free_sizes(draft: Draft) -> Iterator[Symbol]:
    """The sizes that depend on the data: of outputs alone, sources left out."""
    for task in draft.tasks.values():
        if not task.node.source:
            yield from ((task.id, symbol) for symbol in task.node.free_symbols)


def _find(root: dict[Symbol, Symbol], symbol: Symbol) -> Symbol:
    while root[symbol] != symbol:
        symbol = root[symbol]
    return symbol


End = tuple[Task, str, Dim]


def _join(root: dict[Symbol, Symbol], fixed: dict[Symbol, Bound], a: End, b: End) -> None:
    (task_a, port_a, dim_a), (task_b, port_b, dim_b) = a, b
    by_a, by_b = f"{task_a.id}.{port_a}", f"{task_b.id}.{port_b}"
    if isinstance(dim_a, int) and isinstance(dim_b, int):
        if dim_a != dim_b:
            raise _clash(task_a, port_a, Bound(dim_a, by_a), Bound(dim_b, by_b))
        return
    if isinstance(dim_a, int) or isinstance(dim_b, int):
        symbol = (task_a.id, dim_a) if isinstance(dim_a, str) else (task_b.id, str(dim_b))
        bound = Bound(dim_a, by_a) if isinstance(dim_a, int) else Bound(int(dim_b), by_b)
        _fix(root, fixed, symbol, bound, task_a, port_a)
        return
    root_a, root_b = _find(root, (task_a.id, dim_a)), _find(root, (task_b.id, dim_b))
    if root_a != root_b:
        root[root_a] = root_b
        if root_a in fixed:
            _fix(root, fixed, root_b, fixed[root_a], task_a, port_a)


def _fix(
    root: dict[Symbol, Symbol],
    fixed: dict[Symbol, Bound],
    symbol: Symbol,
    bound: Bound,
    task: Task,
    port: str,
) -> None:
    top = _find(root, symbol)
    if top in fixed and fixed[top].size != bound.size:
        raise _clash(task, port, bound, fixed[top])
    fixed.setdefault(top, bound)


def _clash(task: Task, port: str, a: Bound, b: Bound) -> GraphError:
    return GraphError(
        f"{task.entry.where(f'in.{port}')}: sizes clash: {a.by} has {a.size}, {b.by} has {b.size}"
    )
