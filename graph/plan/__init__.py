"""From a graph to the steps of a run: one pass, one file."""
