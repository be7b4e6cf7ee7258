"""Fit a film's model of light and slope to balls, and judge their radius by it."""
