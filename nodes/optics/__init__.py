"""The physics as plain functions that nodes share: each formula once, with its equation's label.

Light of near LEDs (N1), the film's (F1, F2) and its coat's, light from film to film (B1), the
lens (L1, L2), the reflectance map (M1), the fit of a normal; interpolation, cells, shapes, and
sheets of presses.  ``kernels/headers`` has the same formulas for devices, under the same labels.  A
new formula goes here.
"""
