"""The planning passes, in order: names, ports, sizes, backends, transfers, order."""
