"""What a film costs a touch is said to a person, where that takes no time."""

import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tactograph
from tactograph.graph.run.open_pipeline import load
from tactograph.nodes import Film
from tactograph.nodes.calibrate.rating.say_touch_cost import CLEAR_LINE, say_touch_cost
from tactograph.nodes.optics.film import matt_film
from tests.fixtures import Calibration

MATT = matt_film(np.ones((4, 3), np.float32))
COATED = MATT._replace(refraction=1.4)
SHINING = COATED._replace(albedo=0.5)


@pytest.mark.parametrize(
    ("film", "terminal", "built", "parts"),
    [
        (SHINING, True, True, "light from film to film N ms, the coat N ms"),
        (COATED, True, True, "the coat N ms"),
        (MATT, True, True, ""),
        (SHINING, False, True, ""),
        (SHINING, True, False, ""),
    ],
    ids=["shining", "coated", "matt", "a pipe", "kernels to compile"],
)
def test_the_parts_of_a_film_are_priced_for_a_person(
    film: Film,
    terminal: bool,
    built: bool,
    parts: str,
    calibration: Calibration,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def opened(*given: Any, **words: Any) -> Any:
        pipeline = load(*given, **words)
        pipeline.built = built
        return pipeline

    monkeypatch.setattr(tactograph, "load", opened, raising=False)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: terminal)
    file = Path(calibration("near33"))
    with np.load(file) as arrays:
        image = arrays["flat"]
    say_touch_cost(image, film, file=file)
    height, width = image.shape[1:]
    said = re.sub(r"\d+ ms", "N ms", capsys.readouterr().out)
    head = f"{CLEAR_LINE}a touch of {width} x {height} on this film: reconstruct N ms; of it"
    assert said == (f"{head} {parts}\n" if parts else "")
