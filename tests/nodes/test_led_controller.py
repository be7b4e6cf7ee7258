"""The LED controller behind a pseudo-terminal: what it is told, and what happens to it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tactograph.nodes._led_controller import LedController, open_controller
from tactograph.nodes._simulated_controller import SimulatedController

STEP = 0.02


@pytest.fixture
def board(tmp_path: Path) -> Iterator[SimulatedController]:
    with SimulatedController(link=tmp_path / "led") as board:
        yield board


@pytest.fixture
def controller(board: SimulatedController, tmp_path: Path) -> Iterator[LedController]:
    with open_controller(str(tmp_path / "led")) as controller:
        yield controller


def lit(board: SimulatedController) -> list[int]:
    """The LEDs that are lit now."""
    now = time.monotonic()
    return [led for led, _ in board.lit_between(now - 1e-4, now)]


def test_one_led_is_lit_at_a_time(board: SimulatedController, controller: LedController) -> None:
    for led in (1, 2, 3, 4):
        controller.set(led)
        time.sleep(0.001)
        assert lit(board) == [led]
    controller.off()
    time.sleep(0.001)
    assert lit(board) == []


def test_the_host_knows_which_led_is_lit_when(
    board: SimulatedController, controller: LedController
) -> None:
    controller.start_cycle([1, 2, 3, 4, 0], step_s=STEP)
    time.sleep(20 * STEP)
    end = time.monotonic()
    clear = 0
    for i in range(400):
        moment = end - i * 15 * STEP / 400
        shares = board.lit_between(moment - STEP / 10, moment + STEP / 10)
        if len(shares) > 1 or (shares and shares[0][1] < 0.99):
            continue
        clear += 1
        assert controller.step_at(moment) == (shares[0][0] if shares else 0)
    assert clear > 200
