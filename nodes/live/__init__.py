"""A sensor at work.

Cameras, the LED controller and its protocol, frames matched to LEDs, previews and viewers;
real or simulated.  A new camera goes here.
"""
