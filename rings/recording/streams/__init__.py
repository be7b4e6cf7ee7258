"""Streams of touches, by the suffix of their files."""
