"""Write a graph as a file that reads back as the same graph."""

import io

from ruamel.yaml import YAML

from tactograph.graph.files.flat_graph import Graph


def dump_graph(graph: Graph) -> str:
    """The graph file, with `extends` and `patch` applied."""
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.width = 100
    stream = io.StringIO()
    yaml.dump(graph.as_dict(), stream)
    return f"# {graph.name}, hash {graph.hash}\n{stream.getvalue()}"
