"""Drawings, pictures and tables of plain data, for `plan`, `run`, `compare` and `tune`."""
