"""Touches from a camera's frames: match frames to LEDs, count faults."""
