"""Filters of image processing that know nothing of touch: blur, threshold, mask, morphology.

The NumPy side is OpenCV's function of the same name, applied to the image of each LED.
Another filter goes here.
"""
