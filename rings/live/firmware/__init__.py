"""The LED controller's firmware: MicroPython for a Raspberry Pi Pico.

`protocol` and `controller` hold its logic and touch no pin, so they run under CPython as well:
the tests and the simulated controller use them as they are.  `main` runs on the board only.
The protocol is described in rings/live/docs/hardware.md.
"""
