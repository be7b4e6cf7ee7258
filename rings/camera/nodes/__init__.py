"""Marks of a grid, and the lens that shows them where they are."""
