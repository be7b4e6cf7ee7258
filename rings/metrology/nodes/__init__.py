"""Surfaces and scans."""
