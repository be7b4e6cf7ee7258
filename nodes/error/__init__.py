"""The standard deviation of every height, and what it comes from."""
