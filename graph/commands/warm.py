"""``tactograph warm``: build a graph's kernels ahead of its first run."""

from tactograph.graph.commands import RunOptions, graph_command, say
from tactograph.graph.errors import InputError


@graph_command("warm", short_help="Build a graph's kernels ahead of its first run.")
def command(graph: str, values: tuple[str, ...], options: RunOptions) -> None:
    """Build the kernels of GRAPH, as when a robot boots, and keep them on disk.

    They serve every process of this user on this device, as long as kernels and driver stay the
    same.  Some depend on the calibration and on the image: if all values that GRAPH needs are
    given, one item is run as well.  Nothing else is written.
    """
    from tactograph.graph.plan.make_plan import make_plan

    read = options.read(graph)
    arguments = read.read_words(values)
    device, reason = options.open_device(read)
    if device is None:
        raise InputError(f"{read.name}: no kernels to build: {reason}")
    plan = make_plan(read, {**read.placeholders, **arguments}, device=device)
    placed = [(plan.tasks[name].node, place) for name, place in plan.placements.items()]
    nodes = [node for node, place in placed if place.on_device]
    nodes += [node.calls[name] for node, place in placed for name in place.calls]
    count = device.build(nodes)
    missing = read.placeholders.keys() - arguments.keys()
    if not missing:
        next(options.open(read, arguments, sinks=False).items(), None)
    rest = f"; the rest follows with {', '.join(sorted(missing))}" if missing else ""
    say(f"{read.name}: {count} programs are built for {device.name}{rest}")
