"""Plans of graphs, each made once, as several tests read those of shipped graphs."""

from functools import cache

from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.plan.make_plan import make_plan
from tactograph.graph.plan.plan import Plan


@cache
def planned(file: str, device: OpenCL | None) -> Plan:
    """The plan of a file that does not change, or of a shipped graph."""
    graph = read_graph(file)
    return make_plan(graph, graph.placeholders, device=device)
