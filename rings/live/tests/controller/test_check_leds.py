"""`tactograph run check_leds` against a controller made of software."""

import signal
import subprocess
import sys
import threading
import time

import pytest

from rings.live.tests.faulty import FaultyController
from tactograph.graph import TactographError
from tactograph.rings.live.nodes.controller.check_leds import check_leds
from tests.graph.conftest import Command, one_line, tactograph  # noqa: F401

pytestmark = pytest.mark.realtime


def test_every_led_is_lit_in_turn_and_the_cycle_is_timed() -> None:
    with FaultyController() as board:
        board.burnt_out.add(2)
        start = time.monotonic()
        found = check_leds(port=board.port, seconds_each=0.05, rate_hz=200, cycles=10)
        lit = {led for led, _ in board.lit_between(start, time.monotonic())}
        now = time.monotonic()
        assert board.lit_between(now - 1e-3, now) == []
    assert lit == {1, 3, 4}
    assert "firmware 1.0" in found.controller
    assert found.figures["leds"] == 4
    assert found.figures["cycle_ms"] == pytest.approx(25, abs=0.01)
    assert found.figures["bad_lines"] == 0


def test_a_controller_lost_meanwhile_is_an_error() -> None:
    with FaultyController() as board:
        threading.Timer(0.2, board.unplug).start()
        with pytest.raises(TactographError, match="LED controller"):
            check_leds(port=board.port, seconds_each=0.2, rate_hz=200)


def test_ctrl_c_switches_the_leds_off() -> None:
    def lit() -> bool:
        now = time.monotonic()
        assert now < end, "hangs"
        return bool(board.lit_between(now - 1e-3, now))

    with FaultyController() as board:
        command = ["run", "check_leds", f"port={board.port}", "seconds_each=60"]
        end = time.monotonic() + 60
        with subprocess.Popen([sys.executable, "-m", "tactograph.graph.command", *command]) as run:
            while not lit():
                time.sleep(0.01)
            run.send_signal(signal.SIGINT)
            run.wait(end - time.monotonic())
        assert not lit()


def test_it_is_a_command(tactograph: Command) -> None:  # noqa: F811
    with FaultyController() as board:
        words = f"port={board.port}", "seconds_each=0.01", "--figures"
        done = tactograph("run", "check_leds", *words)
        assert done.code == 0, done.err
        assert "round_trip_ms" in done.out
        assert "firmware 1.0, id e6614c311b000000" in done.out
    message = one_line(tactograph("run", "check_leds", "port=/dev/ttyACM77"))
    assert "there is no such port" in message
