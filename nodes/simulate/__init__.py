"""Simulated sensors.

Shapes, the press into a soft film, LEDs, and the renderer.
A new shape goes here.
"""
