"""The LED controller behind a pseudo-terminal: its commands, and its faults."""

import itertools
import os
import re
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import serial

from rings.live.tests.faulty import FaultyController, on_usb
from tactograph.graph import InputError
from tactograph.rings.live.firmware.protocol import frame
from tactograph.rings.live.nodes.controller._led_port import open_port
from tactograph.rings.live.nodes.controller.led_controller import (
    ControllerLostError,
    LedController,
    open_controller,
)

pytestmark = pytest.mark.realtime

STEP = 0.02


@pytest.fixture
def board(tmp_path: Path) -> Iterator[FaultyController]:
    with FaultyController(link=tmp_path / "led") as board:
        yield board


@pytest.fixture
def controller(board: FaultyController, tmp_path: Path) -> Iterator[LedController]:
    with open_controller(str(tmp_path / "led")) as controller:
        yield controller


def lit(board: FaultyController) -> list[int]:
    """The LEDs that are lit now."""
    now = time.monotonic()
    return [led for led, _ in board.lit_between(now - 1e-4, now)]


def test_one_led_is_lit_at_a_time(board: FaultyController, controller: LedController) -> None:
    for led in (1, 2, 3, 4):
        controller.set(led)
        time.sleep(0.001)
        assert lit(board) == [led]
    controller.set(0)
    time.sleep(0.001)
    assert lit(board) == []


def test_the_host_knows_which_led_is_lit_when(
    board: FaultyController, controller: LedController
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


# What goes wrong at the start


def refusal(port: str | None, **more: float) -> str:
    """What `open_controller` says, on one line."""
    with pytest.raises(InputError) as caught:
        open_controller(port, timeout_s=0.2, **more)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_controller_is_found_by_its_usb_id(
    monkeypatch: pytest.MonkeyPatch, board: FaultyController
) -> None:
    on_usb(monkeypatch, board)
    with open_controller() as controller:
        assert controller.port == board.port
        assert controller.identity.leds == 4


def test_of_two_boards_the_one_with_the_firmware_is_taken(
    monkeypatch: pytest.MonkeyPatch, board: FaultyController
) -> None:
    with FaultyController(protocol=7) as other:
        on_usb(monkeypatch, other, board)
        with open_controller(timeout_s=0.2) as controller:
            assert controller.port == board.port


def test_without_a_controller_the_ports_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    on_usb(monkeypatch)
    message = refusal(None)
    assert "no LED controller found" in message
    assert "`port`=simulated for a simulated camera" in message
    assert "/dev/ttyUSB9 (Mouse)" in message


def test_a_missing_port(monkeypatch: pytest.MonkeyPatch, board: FaultyController) -> None:
    on_usb(monkeypatch, board)
    message = refusal("/dev/ttyACM77")
    assert "no such port" in message
    assert f"there is a controller at {board.port}" in message


def test_no_two_hosts_have_one_board(board: FaultyController, controller: LedController) -> None:
    assert "taken by another program" in refusal(board.port)


def test_without_permission_the_way_to_it_is_named(board: FaultyController) -> None:
    Path(board.port).chmod(0o000)
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        # A user who is nobody; the superuser may open anything.
        if os.getuid() == 0:
            os.setgid(65534)
            os.setuid(65534)
        try:
            open_controller(board.port)
            os.write(write, b"opened")
        except BaseException as error:
            os.write(write, f"{type(error).__name__}: {error}".encode())
        os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        message = pipe.read().decode()
    os.waitpid(child, 0)
    assert message.startswith(f"InputError: {board.port}: no permission to open it")
    assert "sudo usermod -aG dialout " in message


@pytest.mark.parametrize(
    ("board", "answer", "message"),
    [
        ({"protocol": 2}, None, r"speaks protocol 2, but 1 is needed.*docs/hardware\.md"),
        ({"leds": 3}, None, "has 3 LEDs, 4 are needed"),
        ({}, b"", "no answer within 0.2 s"),
        ({}, b">>> $1 id*0000\r\nTraceback (most recent call last):\r\n", "has no firmware yet"),
    ],
    ids=["another protocol", "too few LEDs", "silence", "no firmware"],
)
def test_a_board_that_does_not_suit_is_refused(
    board: dict[str, Any], answer: bytes | None, message: str
) -> None:
    with FaultyController(**board) as made:
        made.garble = None if answer is None else lambda line: answer
        assert re.search(message, refusal(made.port))


# What goes wrong later


def wait_until(true: Callable[[], bool], seconds: float = 5.0) -> None:
    """Fail if something has not come true by then."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "did not come back"
        time.sleep(0.005)


def in_step(board: FaultyController, controller: LedController) -> bool:
    """Whether the LEDs flash, and the host knows which."""
    now = time.monotonic()
    shares = board.lit_between(now - 1e-4, now)
    return len(shares) == 1 and controller.step_at(now) == shares[0][0]


@pytest.fixture
def flashing(controller: LedController) -> LedController:
    controller.start_cycle([1, 2, 3, 4], step_s=STEP)
    time.sleep(4 * STEP)
    return controller


def recovered(board: FaultyController, flashing: LedController, since: float, record: Any) -> float:
    """Seconds from `since` until LEDs flash as before and the host is in step with them.

    They have to do so for two cycles on end.
    """
    start: float | None = None
    seen = set()
    while start is None or time.monotonic() - start < 8 * STEP:
        now = time.monotonic()
        assert now - since < 10, "did not come back"
        if not (flashing.connected and in_step(board, flashing)):
            start = None
            seen.clear()
        else:
            start = start or now
            seen |= {led for led, _ in board.lit_between(now - 1e-4, now)}
        time.sleep(0.002)
    assert seen == {1, 2, 3, 4}
    record("recovery_s", round(start - since, 3))
    return start - since


def test_a_cable_pulled_and_put_back(
    board: FaultyController, flashing: LedController, record_property: Any
) -> None:
    board.unplug()
    wait_until(lambda: not flashing.connected)
    assert flashing.step_at(time.monotonic()) is None
    with pytest.raises(ControllerLostError):
        flashing.set(1)
    time.sleep(0.2)
    board.replug()
    assert recovered(board, flashing, time.monotonic(), record_property) < 5
    assert flashing.faults["controller lost"] == 1
    gone, back = flashing.news()
    assert "is gone" in gone
    assert "is back after" in back
    assert flashing.news() == []


def test_it_is_found_again_on_another_port_by_its_unique_id(
    monkeypatch: pytest.MonkeyPatch, board: FaultyController, record_property: Any
) -> None:
    with FaultyController(uid="another") as other:
        on_usb(monkeypatch, other, board)
        before = board.port
        with open_controller(before) as flashing:
            flashing.start_cycle([1, 2, 3, 4], step_s=STEP)
            board.unplug()
            wait_until(lambda: not flashing.connected)
            board.replug()
            assert board.port != before
            assert recovered(board, flashing, time.monotonic(), record_property) < 5
            assert flashing.port == board.port


@pytest.mark.parametrize("is_told", [True, False])
def test_a_reset_in_the_middle_of_a_cycle(
    board: FaultyController, flashing: LedController, record_property: Any, is_told: bool
) -> None:
    board.garble = lambda line: line if is_told or b"ready" not in line else b""
    board.reset()
    assert recovered(board, flashing, time.monotonic(), record_property) < 5
    assert flashing.faults["controller reset"] == 1


def test_garbage_and_lines_cut_off(
    board: FaultyController, flashing: LedController, record_property: Any
) -> None:
    lines = itertools.count()

    def garble(line: bytes) -> bytes:
        kind = next(lines) % 3
        return line if kind == 0 else line[: len(line) // 2] if kind == 1 else b"\xff\x00$*" + line

    board.garble = garble
    board.noise(bytes(range(256)) * 4)
    for _ in range(4):
        assert flashing.status().state == "cycle"
    board.garble = None
    assert recovered(board, flashing, time.monotonic(), record_property) < 5
    assert flashing.faults["bad line"] > 2
    assert flashing.faults["controller lost"] == 0


HUGE = b"9" * 330


@pytest.mark.parametrize("word", [HUGE, b"-1", b"1_0", b"1e3", b""])
@pytest.mark.parametrize("event", [b"! cycle 1 ", b"! watchdog ", b"! cycle "])
def test_an_event_without_a_valid_number_is_a_bad_line(
    board: FaultyController, flashing: LedController, event: bytes, word: bytes
) -> None:
    board.noise(frame((event + word).decode()))
    wait_until(lambda: flashing.faults["bad line"] == 1)
    assert flashing.connected
    assert flashing.status().state == "cycle"


def test_an_answer_without_a_valid_number_loses_the_controller(
    board: FaultyController, controller: LedController
) -> None:
    def garble(line: bytes) -> bytes:
        start, is_time, _ = line.partition(b" t=")
        return frame((start[1:] + is_time + HUGE).decode()) if is_time else line

    board.garble = garble
    with pytest.raises(ControllerLostError, match="makes no sense"):
        controller.status()
    with pytest.raises(ControllerLostError, match="makes no sense"):
        controller.set(1)
    board.garble = None
    wait_until(lambda: controller.connected)
    controller.set(1)


def test_a_time_that_contradicts_those_before_moves_no_clock(
    board: FaultyController, flashing: LedController
) -> None:
    wait_until(lambda: flashing.clock_error_s < 0.1)
    soon = flashing.status().time_us + 957_000
    board.noise(frame(f"! cycle 7 {soon}"))
    wait_until(lambda: flashing.faults["clock jumped"] == 1)
    assert flashing.clock_error_s < 0.1
    assert "clock contradicts" in " ".join(flashing.news())
    wait_until(lambda: in_step(board, flashing))


def test_a_controller_that_hangs_for_a_while(
    board: FaultyController, flashing: LedController, record_property: Any
) -> None:
    board.freeze(0.7)
    end = time.monotonic() + 0.7
    wait_until(lambda: not flashing.connected)
    time.sleep(end - time.monotonic())
    assert recovered(board, flashing, end, record_property) < 5
    assert flashing.faults["controller lost"] == 1


def test_a_cycle_that_was_asked_of_a_controller_that_hung_runs_once_it_is_back(
    board: FaultyController, flashing: LedController
) -> None:
    flashing.set(0)
    board.freeze(1.5)
    with pytest.raises(ControllerLostError):
        flashing.start_cycle([1, 2], step_s=STEP)
    wait_until(lambda: in_step(board, flashing))


def test_a_host_that_was_silent_finds_its_cycle_again(tmp_path: Path) -> None:
    with FaultyController() as board, open_controller(board.port, watchdog_s=0.1) as slow:
        # The host looks after it less often than this watchdog wants.
        slow.start_cycle([1, 2], step_s=STEP)
        wait_until(lambda: slow.faults["host silent"] > 0)
        wait_until(lambda: in_step(board, slow))


def test_leds_go_off_by_themselves_when_the_host_dies(board: FaultyController) -> None:
    with serial.serial_for_url(board.port, timeout=1) as port:
        port.write(frame("1 watchdog 200") + frame("2 set 3"))
        port.read_until(b"\n")
        wait_until(lambda: lit(board) == [3])
        wait_until(lambda: lit(board) == [])


def test_closing_switches_the_leds_off(board: FaultyController, tmp_path: Path) -> None:
    with open_controller(board.port) as controller:
        controller.start_cycle([1, 2, 3, 4], step_s=STEP)
        wait_until(lambda: lit(board) != [])
    assert lit(board) == []


def test_closing_after_the_cable_was_pulled_does_not_wait_for_it(
    board: FaultyController, controller: LedController
) -> None:
    board.unplug()
    closing = threading.Thread(target=lambda: (controller.close(), controller.close()), daemon=True)
    closing.start()
    closing.join(timeout=10)
    assert not closing.is_alive()


def test_a_refusal_by_the_controller_is_reported_with_its_reason(controller: LedController) -> None:
    with pytest.raises(InputError, match="LED must be a whole number from 0 to 4"):
        controller.set(5)
    with pytest.raises(InputError, match="do not suit"):
        controller.start_cycle([1], step_s=0.01, on_s=0.00999)


def test_many_threads_may_ask(controller: LedController) -> None:
    def ask(_: int) -> None:
        for _ in range(40):
            assert controller.status().state == "off"

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(ask, [1, 2, 3, 4]))


@pytest.mark.parametrize("port", ["spy:///dev/null?file=written", "socket://localhost:1"])
def test_a_url_is_not_a_port(port: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="is no device"):
        open_port(port, 1.0)
    assert not list(tmp_path.iterdir())
