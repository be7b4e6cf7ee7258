"""The standard deviation of every height, and its causes."""
