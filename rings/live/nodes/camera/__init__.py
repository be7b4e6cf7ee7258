"""Cameras: find, open, set and read them.  A new camera goes here."""
