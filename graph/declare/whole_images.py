"""Whether a source may leave images as the camera's integers: then less has to go to a device."""

from __future__ import annotations

from typing import NewType

Whole = NewType("Whole", bool)
"""The type of a source's keyword-only argument that says so.

True where the device alone reads the images.  A source that takes it may then yield K x H x W
unsigned integers, which count as fractions of their full scale.
"""
FRACTIONS = Whole(False)
