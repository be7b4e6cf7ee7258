"""Right touches of a sensor, drawn from its calibration, and what the checks say of them."""
