"""The film at rest and the camera's noise."""
