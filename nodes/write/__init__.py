"""Results as files.

The result folder, heights in other people's formats, and heights read back.
A new export goes here.
"""
