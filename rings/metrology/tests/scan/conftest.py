"""A light model of a made-up sensor."""

from pathlib import Path

import pytest

from rings.metrology.tests.scan.scans import write_model
from tactograph.rings.metrology.nodes.scan.light_model import LightModel
from tactograph.rings.metrology.nodes.scan.read_light_model import read_light_model


@pytest.fixture
def model_file(tmp_path: Path) -> Path:
    write_model(tmp_path / "model.yaml")
    return tmp_path / "model.yaml"


@pytest.fixture
def model(model_file: Path) -> LightModel:
    return read_light_model(file=model_file).model
