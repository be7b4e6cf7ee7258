"""Simulated cameras, sensors and LED controllers."""
