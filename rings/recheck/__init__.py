"""Whether a calibration still holds, and carrying it over to a new film."""
