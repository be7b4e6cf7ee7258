"""Images as the camera's integers, which are fewer bytes to upload than fractions."""

from __future__ import annotations

from typing import NewType

Whole = NewType("Whole", bool)
"""The type of a source's keyword-only argument that is true where only a device reads the images.

The source may then yield K x H x W unsigned integers, which count as fractions of full scale.
"""
FRACTIONS = Whole(False)
