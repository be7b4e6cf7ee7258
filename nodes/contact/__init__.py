"""What is pressed against the film, from its height.

Where the contacts are, how large and how deep.
What is said of a contact goes here.
"""
