"""The part of the firmware that touches pins, on a board that is pretended.

Its PIO programs run cycle by cycle, so that steps, on-times and pulses are known to the
microsecond.
"""

import builtins
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from tactograph.rings.live.firmware import controller
from tactograph.rings.live.firmware.protocol import frame

MAIN = Path(__file__).parents[2] / "firmware" / "main.py"


class Program:
    """A PIO program: its instructions as the decorator of MicroPython would take them."""

    def __init__(self, text: Callable[[], None]) -> None:
        self.code: list[tuple[Any, ...]] = []
        self.labels: dict[str, int] = {}
        self.first, self.last = 0, None
        words: dict[str, Any] = {
            name: (lambda *a, name=name: self.code.append((name, *a)))
            for name in ("pull", "mov", "irq", "jmp", "wait", "set")
        }
        # `irq` and `set` are also operands; an instruction stands where it is called.
        words |= {name: name for name in ("block", "x", "osr", "pins", "x_dec")}
        words |= {"rel": lambda n: ("rel", n), "label": self._label}
        words |= {"wrap_target": self._target, "wrap": self._wrap}
        exec(text.__code__, words)

    def _label(self, name: str) -> None:
        self.labels[name] = len(self.code)

    def _target(self) -> None:
        self.first = len(self.code)

    def _wrap(self) -> None:
        self.last = len(self.code) - 1


class StateMachine:
    """One state machine at one instruction a microsecond."""

    flags: set[int]
    raised: set[int]
    pin: list[int]

    def __init__(self, number: int, program: Program, freq: int, set_base: Any = None) -> None:
        assert freq == 1_000_000
        self.number, self.program, self.handler = number, program, lambda _: None
        self.restart()
        self.on = 0
        self.fifo: list[int] = []

    def irq(self, handler: Callable[[Any], None], hard: bool) -> None:
        assert hard
        self.handler = handler

    def restart(self) -> None:
        self.at, self.x, self.osr = 0, 0, 0

    def put(self, word: int) -> None:
        assert word >= 0
        self.fifo.append(word)

    def active(self, on: int) -> None:
        self.on = on

    def exec(self, text: str) -> None:
        if text == "set(pins, 0)":
            self.pin[0] = 0
        else:
            self.flags.discard(int(text.removeprefix("irq(clear, ").removesuffix(")")))

    def cycle(self) -> None:
        """Carry out one instruction."""
        if not self.on:
            return
        verb, *operands = self.program.code[self.at]
        following = self.program.first if self.at == self.program.last else self.at + 1
        if verb == "pull":
            if not self.fifo:
                return
            self.osr = self.fifo.pop(0)
        elif verb == "mov":
            self.x = self.osr
        elif verb == "set":
            self.pin[0] = operands[1]
        elif verb == "wait":
            if operands[2] not in self.flags:
                return
            self.flags.discard(operands[2])
        elif verb == "irq":
            if isinstance(operands[0], tuple):
                self.handler(self)
            else:
                self.raised.add(operands[0])
        elif verb == "jmp":
            if self.x:
                following = self.program.labels[operands[1]]
            self.x -= 1
        self.at = following


class Pico:
    """A pretended Pico whose clock goes on as its state machines are stepped."""

    def __init__(self) -> None:
        self.time = 0
        self.trigger = [0]
        self.flags: set[int] = set()
        self.raised: set[int] = set()
        self.machines: list[StateMachine] = []
        self.lit: dict[int, int] = {}
        self.changes: list[tuple[int, str, int]] = []
        self.sent: list[bytes] = []

    def pass_time(self, microseconds: int) -> None:
        for _ in range(microseconds):
            before = self.trigger[0]
            for machine in self.machines:
                machine.cycle()
            # A flag is seen in the cycle after it was raised.
            self.flags |= self.raised
            self.raised.clear()
            if self.trigger[0] != before:
                self.changes.append((self.time, "trigger", self.trigger[0]))
            self.time += 1

    def light(self, pin: int, on: int) -> None:
        assert on in (0, 1)
        if self.lit.get(pin, 0) != on:
            self.changes.append((self.time, f"GP{pin}", on))
        self.lit[pin] = on

    def state_machine(self, *arguments: Any, **named: Any) -> StateMachine:
        machine = StateMachine(*arguments, **named)
        machine.flags, machine.raised, machine.pin = self.flags, self.raised, self.trigger
        self.machines.append(machine)
        return machine

    def modules(self, read: Callable[[int], bytes]) -> dict[str, Any]:
        """What main.py imports."""
        light = self.light

        class Pin:
            OUT = 1

            def __init__(self, number: int, mode: int, value: int) -> None:
                assert (mode, value) == (self.OUT, 0)
                self.number = number

            def value(self, on: int) -> None:
                light(self.number, on)

        poll = SimpleNamespace(register=lambda *_: None, poll=lambda wait_ms: wait_ms)
        return {
            "machine": SimpleNamespace(Pin=Pin, unique_id=lambda: b"\xe6\x61"),
            "micropython": SimpleNamespace(
                alloc_emergency_exception_buf=lambda size: None, kbd_intr=lambda byte: None
            ),
            "rp2": SimpleNamespace(
                asm_pio=lambda **_: Program,
                PIO=SimpleNamespace(OUT_LOW=0),
                StateMachine=self.state_machine,
            ),
            "select": SimpleNamespace(poll=lambda: poll, POLLIN=1),
            "sys": SimpleNamespace(
                stdin=SimpleNamespace(buffer=SimpleNamespace(read=read)),
                stdout=SimpleNamespace(buffer=SimpleNamespace(write=self.sent.append)),
            ),
            "time": SimpleNamespace(ticks_us=lambda: self.time),
            "firmware.controller": controller,
        }


def run_main(*host: str | int) -> Pico:
    """Run main.py; the host says lines, or lets so many microseconds pass, and ends it."""
    pico = Pico()

    def script() -> Iterator[bytes]:
        for one in (*host, "99 quit"):
            if isinstance(one, int):
                pico.pass_time(one)
            else:
                yield frame(one)

    commands = script()
    modules = pico.modules(lambda size: next(commands))

    def find(name: str, *rest: Any) -> Any:
        return modules[name] if name in modules else __import__(name, *rest)

    scope = {"__builtins__": {**vars(builtins), "__import__": find}, "__name__": "main"}
    exec(compile(MAIN.read_text(), str(MAIN), "exec"), scope)
    return pico


def times(pico: Pico, what: str, *, on: bool) -> list[int]:
    return [time for time, name, value in pico.changes if name == what and bool(value) == on]


def test_it_says_who_it_is() -> None:
    pico = run_main("1 id")
    who = "name=tactograph-led protocol=1 firmware=1.0 leds=4 uid=e661"
    assert pico.sent[:2] == [frame("! ready e661 1"), frame(f"1 ok {who}")]


def test_steps_on_times_and_pulses_are_exact_to_the_microsecond() -> None:
    pico = run_main("1 cycle 1,2,3,4,0 2000 1200 50", 40_000)
    rises = times(pico, "trigger", on=True)
    assert len(rises) == 20
    assert set(np.diff(rises)) == {2000}
    assert {off - on for on, off in zip(rises, times(pico, "trigger", on=False), strict=True)} == {
        50
    }
    for k, pin in enumerate((2, 3, 4, 5)):
        on, off = times(pico, f"GP{pin}", on=True), times(pico, f"GP{pin}", on=False)
        assert set(np.diff(on)) == {10_000}
        assert {b - a for a, b in zip(on, off, strict=True)} == {1200}
        assert on[0] - times(pico, "GP2", on=True)[0] == 2000 * k
        # The pulse rises as the light does.
        assert min(abs(on[0] - rise) for rise in rises) <= 2


def test_without_on_time_or_pulse_one_led_follows_the_other_at_once() -> None:
    pico = run_main("1 cycle 1,2 1000 1000 0", 10_000)
    assert times(pico, "trigger", on=True) == []
    assert times(pico, "GP2", on=False)[:4] == times(pico, "GP3", on=True)[:4]
    assert set(np.diff(times(pico, "GP2", on=True))) == {2000}


def test_a_new_cycle_starts_clean() -> None:
    pico = run_main("1 cycle 1,2 1000 500 0", 3300, "2 cycle 3,4 700 300 20", 7000, "3 off", 5000)
    started = times(pico, "GP4", on=True)[0]
    assert 3300 <= started <= 3310
    # No pulse is left over from the cycle before, which asked for none.
    assert times(pico, "trigger", on=True)[0] - started <= 2
    assert set(np.diff(times(pico, "trigger", on=True))) == {700}
    assert max(times(pico, "GP5", on=True)) < 3300 + 7000 + 10
    assert set(pico.lit.values()) == {0}


def test_silence_switches_the_leds_off() -> None:
    pico = run_main("1 watchdog 100", "2 set 1", 99_000, "x", 2000, "x")
    assert times(pico, "GP2", on=False)[-1] >= 100_000
    assert any(line.startswith(b"$! watchdog") for line in pico.sent)


def test_the_leds_are_off_when_it_ends() -> None:
    assert set(run_main("1 set 4", 100).lit.values()) == {0}
