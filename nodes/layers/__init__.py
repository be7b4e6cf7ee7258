"""The kinds of layers of a touch, one file each: their type, and how they are written and drawn."""
