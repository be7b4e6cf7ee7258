"""Rate a calibration, plot it, and advise what to press next."""
