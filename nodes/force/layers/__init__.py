"""Layers that this room adds to a touch."""
