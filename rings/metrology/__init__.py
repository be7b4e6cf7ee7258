"""Surface metrology: scans that flash, grooves and steps, texture, formats of ISO 25178."""
