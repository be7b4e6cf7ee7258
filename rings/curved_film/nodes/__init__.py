"""The shape of a film at rest, for a calibration with a ball."""
