"""Motion, force and markers."""
