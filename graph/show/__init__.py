"""Drawings, pictures and tables of plain data, for `plan`, `run` and `compare`."""
