"""Motion from frame to frame."""
