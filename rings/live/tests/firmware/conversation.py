"""A conversation with the firmware that prints all that happens, under any Python.

Only what MicroPython has is used here.
"""

try:
    import micropython

    lock, unlock = micropython.heap_lock, micropython.heap_unlock
except ImportError:

    def lock():
        pass

    def unlock():
        pass


RIGHT = (
    "1 id", "2 set 3", "3 off", "4 set 0", "5 watchdog 3000", "6 status",
    "7 cycle 1,2,3,4,0 33333 20000 100",
)  # fmt: skip
WRONG = (
    "9 set 5", "10 set", "11 set x", "12 set -1", "13 off 1",
    "14 cycle 1,,2 33333 20000 0", "15 cycle 1,2 33333 33300 0", "16 cycle 1,2 33333 33333 5",
    "17 cycle 9 33333 20000 0", "18 cycle 1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1 33333 20000 0",
    "19 watchdog 99999", "20 dance", "x id", "21", "", "22 status",
)  # fmt: skip


class Board:
    """A board whose time passes by hand."""

    def __init__(self, wrap):
        self.wrap = wrap
        self.tick = wrap - 100000
        self.levels = [0] * 5

    def ticks(self):
        return self.tick

    def light(self, led, on):
        self.levels[led] = on

    def run(self, period, on, trigger):
        print("run", period, on, trigger)

    def halt(self):
        print("halt")

    def send(self, data):
        print("sent", data)


def converse(Controller, frame, wrap):
    board = Board(wrap)
    controller = Controller(board, 4, "e66")

    def say(body):
        print("answer", body)
        controller.receive(frame(body))
        print("light", board.levels[1:])

    def later(microseconds):
        board.tick = (board.tick + microseconds) & wrap

    def interrupt(handler):
        # Memory cannot be had in an interrupt.
        lock()
        handler()
        unlock()
        print("light", board.levels[1:])

    for body in RIGHT:
        say(body)
        later(1000)
    for _ in range(11):
        interrupt(controller.step)
        later(20000)
        interrupt(controller.dark)
        later(13333)
        controller.poll()
        controller.receive(frame("8 status"))
    # The clock has gone round by now.
    for body in WRONG:
        say(body)
    good = frame("23 off")
    torn = (b"\x00\xff\x03garbage$*\n", good[:5], b"\n", good[:-1], good[-1:], b"$" * 500, b"\n")
    changed = (good.lower(), good.replace(b"off", b"set"), b"\r" + good, good + good)
    for data in torn + changed:
        controller.receive(data)
    say("24 set 1")
    later(2900000)
    controller.poll()
    print("light", board.levels[1:])
    later(200000)
    controller.poll()
    print("light", board.levels[1:])
    say("25 status")
    say("26 quit")
    print(controller.asked_to_quit)
