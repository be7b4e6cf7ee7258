"""From light to slope.

Look-up tables, reflectance models, the Taylor step, and what a slope can be trusted with.
A new way to turn light into a slope goes here.
"""
