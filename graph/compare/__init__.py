"""Variants side by side over captures: runs, tables, pictures, one page."""
