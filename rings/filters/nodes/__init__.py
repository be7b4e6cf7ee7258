"""Blurs, thresholds, morphology, resizing and OpenCV functions."""
