"""From light to slope.

Look-up tables, the Taylor step of a reflectance model, and the variance of slopes.
A new way to turn light into a slope goes here.
"""
