"""Surfaces and scans."""

UM_PER_MM = 1e3
