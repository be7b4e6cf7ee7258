"""Trust in a height, judged without knowing the truth.

Maps of what contradicts it, and one verdict.  A new check goes here.
"""
