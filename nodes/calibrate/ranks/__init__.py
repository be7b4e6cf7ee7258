"""Draw valid touches of a sensor from its calibration, and rank the checks of a touch by them."""
