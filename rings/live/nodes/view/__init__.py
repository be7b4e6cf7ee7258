"""Show a stream of touches, and its statistics."""
