"""A median, and OpenCV's functions by name."""
