"""The calibration of a one-shot sensor."""
