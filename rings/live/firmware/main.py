"""Pins, clock and USB of the board: Raspberry Pi Pico or Pico 2 with MicroPython.

Copied to the board as ``main.py``, beside the folder ``firmware`` (docs/hardware.md of this ring).
Change the pins here if your wiring differs.
"""
# ruff: noqa: F821  (the words of PIO programs are defined by their decorator)

import select
import sys
import time
from binascii import hexlify

import machine
import micropython
import rp2
from firmware.controller import Controller

LED_PINS = (2, 3, 4, 5)
TRIGGER_PIN = 15
CHUNK_BYTES = 64
"""Most bytes read at once, so that a flood of them does not block the main loop."""


@rp2.asm_pio()
def step_clock():
    """A step each x + 5 us: starts the pulse and the on-time, and calls the processor."""
    pull(block)
    wrap_target()
    mov(x, osr)
    irq(4)
    irq(5)
    irq(rel(0))
    label("wait")
    jmp(x_dec, "wait")
    wrap()


@rp2.asm_pio(set_init=rp2.PIO.OUT_LOW)
def trigger_pulse():
    """A pulse of x + 2 us at each step."""
    pull(block)
    wrap_target()
    wait(1, irq, 4)
    mov(x, osr)
    set(pins, 1)
    label("wait")
    jmp(x_dec, "wait")
    set(pins, 0)
    wrap()


@rp2.asm_pio()
def on_time():
    """Calls the processor x + 3 us after each step."""
    pull(block)
    wrap_target()
    wait(1, irq, 5)
    mov(x, osr)
    label("wait")
    jmp(x_dec, "wait")
    irq(rel(0))
    wrap()


class Board:
    """The board that `Controller` requires."""

    def __init__(self):
        self.controller = None
        self._leds = [machine.Pin(pin, machine.Pin.OUT, value=0) for pin in LED_PINS]
        trigger = machine.Pin(TRIGGER_PIN, machine.Pin.OUT, value=0)
        self._clock = rp2.StateMachine(0, step_clock, freq=1000000)
        self._pulse = rp2.StateMachine(1, trigger_pulse, freq=1000000, set_base=trigger)
        self._on = rp2.StateMachine(2, on_time, freq=1000000)
        # Interrupts that may come at any time, so that steps are punctual.
        self._clock.irq(self._step, hard=True)
        self._on.irq(self._dark, hard=True)

    def ticks(self):
        return time.ticks_us()

    def light(self, led, on):
        self._leds[led - 1].value(on)

    def run(self, period_us, on_us, trigger_us):
        self.halt()
        if trigger_us:
            self._start(self._pulse, trigger_us - 2)
        if on_us < period_us:
            self._start(self._on, on_us - 3)
        self._start(self._clock, period_us - 5)

    def halt(self):
        self._clock.active(0)
        self._pulse.active(0)
        self._on.active(0)
        # What the clock has already asked for, and a pulse that has begun.
        self._clock.exec("irq(clear, 4)")
        self._clock.exec("irq(clear, 5)")
        self._pulse.exec("set(pins, 0)")

    def send(self, data):
        sys.stdout.buffer.write(data)

    def _start(self, program, word):
        program.restart()
        program.put(word)
        program.active(1)

    def _step(self, _):
        self.controller.step()

    def _dark(self, _):
        self.controller.dark()


def run(board):
    """The main loop, until the host asks the firmware to end."""
    controller = Controller(board, len(LED_PINS), hexlify(machine.unique_id()).decode())
    board.controller = controller
    poll = select.poll()
    poll.register(sys.stdin, select.POLLIN)
    while not controller.asked_to_quit:
        controller.poll()
        if poll.poll(2):
            data = sys.stdin.buffer.read(1)
            while len(data) < CHUNK_BYTES and poll.poll(0):
                data += sys.stdin.buffer.read(1)
            controller.receive(data)


def main():
    micropython.alloc_emergency_exception_buf(100)
    # Ctrl-C is a byte like any other: garbage must not end the firmware.
    micropython.kbd_intr(-1)
    board = Board()
    try:
        run(board)
    except Exception:
        # Pins are inputs during a reset, and the resistors keep the LEDs off.
        machine.reset()
    micropython.kbd_intr(3)


main()
