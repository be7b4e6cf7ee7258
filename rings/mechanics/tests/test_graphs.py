"""Variants that this ring adds to graphs of others."""

from tactograph.graph.files.read_graph import read_graph, with_overlays


def test_a_graphs_own_variant_goes_before_the_overlay_of_that_name() -> None:
    tracked = with_overlays(read_graph("live"), ["markers"])
    assert tracked.hash == read_graph("live_markers").hash
    assert "save_markers" not in tracked.nodes
    assert "save_markers" in read_graph("reconstruct_markers").nodes
