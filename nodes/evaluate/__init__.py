"""Compare results with a known truth.

Errors of heights, slopes, shadows and stated errors, as named figures.
A new metric goes here.
"""
