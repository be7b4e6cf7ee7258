"""Image filters that no shipped graph needs, for graphs of one's own."""
