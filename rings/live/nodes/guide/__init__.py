"""Guide a person through a calibration."""
