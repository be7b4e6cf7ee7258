"""Captures of other software, by the file that lists their images."""
