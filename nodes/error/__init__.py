"""The standard deviation of every height, from its causes."""
