"""Kinds of layers of a touch, one file each: what a layer is, and how it is written and drawn."""
