"""Kinds of layers of a touch."""
