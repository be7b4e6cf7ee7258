"""Compare the film with that of the calibration, and carry a calibration over to another film."""
