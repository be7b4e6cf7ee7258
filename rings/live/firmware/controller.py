"""The LED controller's logic for requests, time and steps; the board handles the pins.

Only features of MicroPython are used.  A board is any object with

``ticks()``
    microseconds, counted modulo 2**30, as ``time.ticks_us`` of MicroPython
``light(led, on)``
    LED `led`, from 1, on (1) or off (0); called from interrupts
``run(period_us, on_us, trigger_us)``
    from now on call `Controller.step` every `period_us`, the first time at once, and
    `Controller.dark` `on_us` after each if that is shorter; give a pulse of `trigger_us` on
    the trigger output at each step, none if 0
``halt()``
    end that
``send(data)``
    bytes to the host
"""

from .protocol import VERSION, Lines, frame

NAME = "tactograph-led"
FIRMWARE = "1.0"
WRAP = 0x3FFFFFFF
MOST_STEPS = 16
SHORTEST_STEP = 500
LONGEST_STEP = 10000000
MARGIN = 100
SHORTEST_PULSE = 10
WATCHDOG = 2000
LONGEST_WATCHDOG = 60000


class RefusedError(Exception):
    """A request that is refused, with the reason."""


def number(word, low, high, what):
    """The whole number that `word` spells, within its range."""
    if not word.isdigit() or len(word) > 9 or not low <= int(word) <= high:
        raise RefusedError(f"{what} must be a whole number from {low} to {high}")
    return int(word)


class Controller:
    """Answers requests and steps through the LEDs.

    `receive` and `poll` belong to the main loop; `step` and `dark` are called from interrupts
    and allocate no memory.
    """

    def __init__(self, board, leds, uid):
        self.board = board
        self.leds = leds
        self.uid = uid
        self.protocol = VERSION
        self.asked_to_quit = False
        self._lines = Lines()
        self._order = (0,)
        self._cycling = False
        self._index = 0
        self._cycle = -1
        self._cycle_tick = 0
        self._step_tick = 0
        self._reported = -1
        self._lit = 0
        self._last_tick = board.ticks()
        self._time = 0
        self._heard = 0
        self._watchdog = WATCHDOG
        self._bitten = 0
        self._off()
        self._send(f"! ready {uid} {VERSION}")

    # Interrupts

    def step(self):
        """Begin a step: switch the previous LED off and the next one on."""
        if not self._cycling:
            return
        tick = self.board.ticks()
        index = self._index + 1
        if index >= len(self._order):
            index = 0
        self._step_tick = tick
        if index == 0:
            self._cycle_tick = tick
            self._cycle += 1
        self._index = index
        self._light(self._order[index])

    def dark(self):
        """End the on-time of a step."""
        self._light(0)

    def _light(self, led):
        if self._lit:
            self.board.light(self._lit, 0)
        self._lit = led
        if led:
            self.board.light(led, 1)

    # Main loop

    def poll(self):
        """Report a cycle that began; switch off if the host has been silent for too long."""
        now = self.now()
        if self._cycling and self._cycle != self._reported:
            cycle, began = self._cycle_start()
            self._reported = cycle
            self._send(f"! cycle {cycle} {began}")
        if now - self._heard > 1000 * self._watchdog and (self._cycling or self._lit):
            self._bitten += 1
            self._halt()
            self._off()
            self._send(f"! watchdog {now}")

    def receive(self, data):
        """Take in bytes from the host and answer the lines they complete."""
        for body in self._lines.feed(data):
            words = body.split()
            if len(words) < 2 or not words[0].isdigit() or len(words[0]) > 9:
                self._lines.bad += 1
                continue
            self._heard = self.now()
            try:
                answer = self._answer(words[1], words[2:])
                self._send(f"{words[0]} ok{answer}")
            except RefusedError as why:
                self._send(f"{words[0]} no {why}")

    def now(self):
        """Microseconds since the start; never goes back to 0.  Call it within 17 minutes."""
        tick = self.board.ticks()
        self._time += (tick - self._last_tick) & WRAP
        self._last_tick = tick
        return self._time

    def _moment(self, tick):
        """The time of a tick of the last 17 minutes."""
        now = self.now()
        return now - ((self._last_tick - tick) & WRAP)

    def _cycle_start(self):
        """Number and time of the newest cycle, read while interrupts may change them."""
        while True:
            cycle, tick = self._cycle, self._cycle_tick
            if cycle == self._cycle:
                return cycle, self._moment(tick)

    def _send(self, body):
        self.board.send(frame(body))

    def _answer(self, verb, words):
        takes = {
            "id": (0, self._id),
            "set": (1, self._set),
            "off": (0, self._all_off),
            "cycle": (4, self._start),
            "watchdog": (1, self._watch),
            "status": (0, self._status),
            "quit": (0, self._quit),
        }
        if verb not in takes:
            raise RefusedError(f"unknown request {verb[:20]}")
        count, carry_out = takes[verb]
        if len(words) != count:
            raise RefusedError(f"{verb} takes {count} values")
        return carry_out(*words)

    def _id(self):
        who = f" name={NAME} protocol={self.protocol} firmware={FIRMWARE}"
        return f"{who} leds={self.leds} uid={self.uid}"

    def _set(self, word):
        led = number(word, 0, self.leds, "LED")
        self._halt()
        self._light(led)
        return f" t={self.now()}"

    def _all_off(self):
        self._halt()
        self._off()
        return f" t={self.now()}"

    def _start(self, order, period, on, trigger):
        leds = tuple([number(word, 0, self.leds, "LED") for word in order.split(",")])
        if len(leds) > MOST_STEPS:
            raise RefusedError(f"a cycle has {MOST_STEPS} steps at most")
        period = number(period, SHORTEST_STEP, LONGEST_STEP, "period")
        on = number(on, MARGIN, period, "on-time")
        trigger = number(trigger, 0, period - MARGIN, "trigger pulse")
        if period - MARGIN < on < period or 0 < trigger < SHORTEST_PULSE:
            # Two interrupts at once could come in the wrong order.
            raise RefusedError(f"on-time {on} and trigger {trigger} do not suit period {period}")
        self._halt()
        self._off()
        self._order = leds
        self._index = len(leds) - 1
        self._cycle = self._reported = -1
        self._cycling = True
        self.board.run(period, on, trigger)
        return f" t={self.now()}"

    def _watch(self, word):
        self._watchdog = number(word, 100, LONGEST_WATCHDOG, "watchdog")
        return ""

    def _status(self):
        cycle, began = self._cycle_start() if self._cycling else (-1, 0)
        state = "cycle" if self._cycling else "set" if self._lit else "off"
        step = self._index if self._cycling else 0
        last = self._moment(self._step_tick) if self._cycling else 0
        return (
            f" state={state} led={self._lit} step={step} cycle={cycle} start={began} last={last}"
            f" t={self.now()} bad={self._lines.bad} bitten={self._bitten}"
        )

    def _quit(self):
        self._halt()
        self._off()
        self.asked_to_quit = True
        return ""

    def _halt(self):
        if self._cycling:
            self._cycling = False
            self.board.halt()

    def _off(self):
        self._lit = 0
        for led in range(1, self.leds + 1):
            self.board.light(led, 0)
