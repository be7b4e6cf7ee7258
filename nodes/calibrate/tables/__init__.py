"""Fit the paper's tables: light to slope, null vector, reflectance."""
