"""Contacts with the film, from its height.

Where the contacts are, how large and how deep.
Another measure of a contact goes here.
"""
