"""Shared by all tests: the device, and the data that may lie beside the repository."""

from __future__ import annotations

from pathlib import Path

import pytest

from tactograph.graph.backends.devices import choose_device
from tactograph.graph.backends.opencl import OpenCL

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared" / "data"


@pytest.fixture(scope="session")
def device() -> OpenCL:
    """An OpenCL device; its absence fails the tests that need it, it does not skip them."""
    found, reason = choose_device()
    assert found is not None, f"{reason}; 'make test' installs one"
    return OpenCL(found)


@pytest.fixture(scope="session")
def raytraced() -> Path:
    """Captures of known shapes by an independent renderer."""
    folder = SHARED / "raytraced"
    if not folder.is_dir():
        pytest.skip("the ray-traced captures (../shared/data/raytraced) are not here")
    return folder


@pytest.fixture(scope="session")
def groove() -> Path:
    """Images of a real sensor with six LEDs."""
    folder = SHARED / "real" / "groove_6led"
    if not folder.is_dir():
        pytest.skip("the real captures (../shared/data/real) are not here")
    return folder
