"""A median, a window of the frame, and OpenCV's functions by name."""
