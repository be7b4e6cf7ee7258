"""Judge a height without knowing the truth.

Maps of what contradicts a touch, and one verdict.  A new check goes here.
"""
