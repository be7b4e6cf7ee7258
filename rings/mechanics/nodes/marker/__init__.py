"""Markers that are printed on the film: where they are, and where a touch moves them.

Markers are M rows (x, y, radius) in px, pixel centres at integers.
"""
