"""What moves from frame to frame."""
