"""The content of files, for people.

One node, which prints and draws a file of any kind that the package writes.  A new kind of file
goes here.
"""
