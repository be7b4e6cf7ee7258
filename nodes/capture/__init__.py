"""Read captures, flat frames and ball presses from files.

Images from folders become light per LED, K x H x W, as fractions of full scale.
A new file format goes here; cameras are in `live`, recordings in `recording`.
"""
