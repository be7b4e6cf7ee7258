"""Results against a known truth.

Errors of heights, slopes, shadows and of stated errors, as named figures.
A new metric goes here.
"""
