"""Rate a calibration, plot it, and say what to press next."""
