"""Presses, the map that is fitted to them, and its file."""
