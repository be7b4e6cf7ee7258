"""Nodes: how they are declared, found, described, and written from templates."""
