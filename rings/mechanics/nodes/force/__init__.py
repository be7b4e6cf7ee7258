"""Pressure and force from the height of a pressed film."""
