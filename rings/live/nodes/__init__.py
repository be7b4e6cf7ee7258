"""Live sensors.

Cameras, the LED controller and its protocol, matching of frames to LEDs, previews and viewers;
real or simulated.  A new camera goes here.
"""
