"""A page on which a graph is changed while its result is seen."""
