"""Whole features on top of the core; delete the folder of one, and it is gone."""
