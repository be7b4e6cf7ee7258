"""Write results to files.

The result folder, and heights read back from files.  A new export goes here.
"""
