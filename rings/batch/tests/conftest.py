"""Fixtures of the engine's tests."""

from tests.graph.conftest import no_device, tactograph, toys, write

__all__ = ["no_device", "tactograph", "toys", "write"]
