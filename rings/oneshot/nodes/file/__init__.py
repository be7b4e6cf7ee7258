"""The file of a one-shot sensor's calibration."""
