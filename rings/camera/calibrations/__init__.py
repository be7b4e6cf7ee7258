"""The kind of a camera's file."""
