"""Pass 3: bind symbolic sizes across the graph.

A symbol (K, H, W) belongs to its node; an edge makes the symbols at its ends one class.
Fixed sizes are checked before anything runs, all others as soon as the sources have yielded.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from tactograph.graph.declare.ports import IMAGE_SIZES, Dim
from tactograph.graph.declare.size_rules import SizeLimit
from tactograph.graph.errors import GraphError, InputError
from tactograph.graph.plan.before import classes_of
from tactograph.graph.plan.draft import Draft, Task, Value

Symbol = tuple[str, str]
"""Node id and size symbol."""


class Bound(NamedTuple):
    """A known size, and the port that it is known from."""

    size: int
    by: str


Bounds = dict[Symbol, Bound]
Shapes = dict[str, tuple[int, ...]]
"""Shapes by output port."""


@dataclass
class Sized:
    """The sizes around a node, valid for every item with the same `before`.

    `before` is compared by identity: the sizes behind a node are the same object from item to
    item as long as the node's outputs keep their shapes.  `doubtful` is set when the node's
    settings have changed, since sizes may follow from them.
    """

    before: Bounds
    derived: Bounds
    sizes: dict[str, int]
    shapes: Shapes | None = None
    after: Bounds = field(default_factory=dict)
    doubtful: bool = False


@dataclass
class SizeClasses:
    """Classes of symbols that have the same size, with the nodes' limits on them."""

    root: dict[Symbol, Symbol]
    fixed: dict[Symbol, Bound]
    limits: dict[Symbol, list[tuple[str, SizeLimit]]]

    def around(self, task: Task, bounds: Bounds, last: Sized | None) -> Sized:
        """The sizes around a node; it is `last` if that follows from the same `bounds`.

        Raises InputError if a derived size clashes with a known one.
        """
        if last is not None and last.before is bounds and not last.doubtful:
            return last
        derived = dict(bounds)
        self.derive(derived, task)
        if last is not None and last.before is bounds and last.derived == derived:
            last.doubtful = False
            return last
        return Sized(bounds, derived, self.sizes_of(task, derived))

    def behind(self, task: Task, sized: Sized, shapes: Shapes) -> Bounds:
        """The sizes that are known behind a node with outputs of these shapes.

        Raises InputError as `bind` does.
        """
        if sized.shapes is not shapes and sized.shapes != shapes:
            after = dict(sized.derived)
            for port, shape in shapes.items():
                self.bind(after, task, port, shape)
            sized.shapes, sized.after = shapes, after
        return sized.after

    def bind(self, bounds: Bounds, task: Task, port: str, shape: tuple[int, ...]) -> None:
        """Enter the shape of an output into `bounds`.

        Raises InputError if a size clashes with a known one, naming both ports, or if a node does
        not accept it, with that node's reason.
        """
        dims = task.node.outputs[port].dims
        for dim, size in zip(dims, shape, strict=True):
            if isinstance(dim, str):
                bound = Bound(size, _in_graph(task, port))
                self._bind_one(bounds, self.root[task.id, dim], dim, bound, dims)

    def derive(self, bounds: Bounds, task: Task) -> None:
        """Enter a node's derived sizes into `bounds`.

        Raises InputError if a derived size clashes with a known one.
        """
        sizes = self.sizes_of(task, bounds) if task.node.derived else {}
        for symbol, parts in task.node.derived.items():
            if sizes.keys() >= {*parts.of.split()}:
                bound = Bound(parts.size(sizes, task.settings), f"{task.id} ({parts})")
                self._bind_one(bounds, self.root[task.id, symbol], symbol, bound)

    def _bind_one(
        self, bounds: Bounds, root: Symbol, dim: str, bound: Bound, dims: tuple[Dim, ...] = ()
    ) -> None:
        other = bounds.get(root) or self.fixed.get(root)
        if other is not None and other.size != bound.size:
            raise InputError(_clash_in_words(dim, dims, bound, other))
        for who, limit in self.limits.get(root, ()):
            if limit.refuses(bound.size):
                raise InputError(f"{who}: {dim} = {bound.size}: {limit.why}")
        bounds.setdefault(root, bound)

    def sizes_of(self, task: Task, bounds: Mapping[Symbol, Bound]) -> dict[str, int]:
        """The known sizes of a node's symbols."""
        sizes: dict[str, int] = {}
        for symbol in task.node.symbols:
            root = self.root[task.id, symbol]
            bound = bounds.get(root) or self.fixed.get(root)
            if bound is not None:
                sizes[symbol] = bound.size
        return sizes


def _in_graph(task: Task, port: str) -> str:
    """A port in words, led by the first of the graph's params that its node takes."""
    param = None if task.stand_in else next(iter(task.entry.params.values()), None)
    return f"{task.id}.{port}" if param is None else f"{param}= ({task.id}.{port})"


def _clash_in_words(dim: str, dims: tuple[Dim, ...], one: Bound, other: Bound) -> str:
    """Describe two clashing sizes; for images, say what they count."""
    if dims[-2:] != ("H", "W") or dim not in IMAGE_SIZES:
        return (
            f"the size {dim} is {one.size} in {one.by} but {other.size} in {other.by}; they have "
            "to be the same"
        )
    ask = "neither cropped, resized nor turned?"
    if dim == "K":
        ask = "and is no image missing or left over?"
    return (
        f"{one.size} {IMAGE_SIZES[dim]} in {one.by}, but {other.size} in {other.by}: do both come "
        f"from one sensor, {ask}"
    )


def unify(draft: Draft) -> SizeClasses:
    """Join the symbols at both ends of every edge.

    Raises GraphError if two fixed sizes disagree, naming both ports, or if a node does not accept a
    fixed size.
    """
    symbols = [(task.id, symbol) for task in draft.tasks.values() for symbol in task.node.symbols]
    joints = [*_joints(draft, "reads")]
    root = classes_of(symbols, _symbols(joints))
    # A size that depends on the data may differ from item to item.
    variable = (task for task in draft.tasks.values() if task.node.finds_sizes)
    classes = {root[task.id, symbol] for task in variable for symbol in task.node.free_symbols}
    free: set[tuple[str, Dim]] = {symbol for symbol in symbols if root[symbol] in classes}
    joints += (each for each in _joints(draft, "recalls") if each.maker not in free)
    root = classes_of(symbols, _symbols(joints))
    fixed = _fixed(draft, root, joints)
    limits: dict[Symbol, list[tuple[str, SizeLimit]]] = {}
    for task in draft.tasks.values():
        for symbol, limit in task.node.sizes.items():
            if not task.filled:
                limits.setdefault(root[task.id, symbol], []).append((task.id, limit))
    for top, bound in fixed.items():
        for who, limit in limits.get(top, ()):
            if limit.refuses(bound.size):
                where = draft.tasks[who].entry.where("in")
                raise GraphError(f"{where}: {bound.by} has size {bound.size}: {limit.why}")
    return SizeClasses(root, fixed, limits)


class _Joint(NamedTuple):
    """One size at both ends of an edge: each end is a node with a symbol or a number."""

    reader: tuple[str, Dim]
    maker: tuple[str, Dim]
    input: str
    value: Value


def _joints(draft: Draft, edges: Literal["reads", "recalls"]) -> Iterator[_Joint]:
    """The sizes at both ends of every array's edge."""
    for task in draft.tasks.values():
        for name, value in getattr(task, edges).items():
            if task.node.inputs[name].kind == "array":
                dims = task.node.inputs[name].dims, draft.port_of(value).dims
                for one, other in zip(*dims, strict=True):
                    yield _Joint((task.id, one), (value.node, other), name, value)


def _symbols(joints: Iterable[_Joint]) -> Iterator[tuple[Symbol, Symbol]]:
    """The joints that have a symbol at both ends."""
    for (reader, one), (maker, other) in (each[:2] for each in joints):
        if isinstance(one, str) and isinstance(other, str):
            yield (reader, one), (maker, other)


def _fixed(
    draft: Draft, root: Mapping[Symbol, Symbol], joints: Iterable[_Joint]
) -> dict[Symbol, Bound]:
    """The sizes of the classes that an edge joins to a number."""
    fixed: dict[Symbol, Bound] = {}
    for each in joints:
        names = (each.reader, f"{each.reader[0]}.{each.input}"), (each.maker, str(each.value))
        bounds = [Bound(dim, by) for (_, dim), by in names if isinstance(dim, int)]
        tops = [root[node, dim] for (node, dim), _ in names if isinstance(dim, str)]
        if not bounds:
            continue
        for top in tops:
            bounds.append(fixed.setdefault(top, bounds[0]))
        a, b = bounds[0], bounds[-1]
        if a.size != b.size:
            where = draft.tasks[each.reader[0]].entry.where(f"in.{each.input}")
            raise GraphError(f"{where}: sizes clash: {a.by} has {a.size}, {b.by} has {b.size}")
    return fixed
