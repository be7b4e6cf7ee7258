"""Calibrate the camera's lens by a grid that lies on the film."""
