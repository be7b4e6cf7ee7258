"""Commands of this ring."""
