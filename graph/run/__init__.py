"""Open a graph and run its plan, item by item."""
