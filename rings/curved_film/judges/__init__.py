"""Doubts of a calibration of a film that is no plane."""
